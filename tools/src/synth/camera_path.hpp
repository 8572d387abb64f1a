// SPDX-License-Identifier: BSD-3-Clause
// How the camera moves through the synthetic office.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>

#include "dynslam/geometry/se3.hpp"
#include "synth/random.hpp"

namespace dynslam::runtime::synth {

/// Hand shake: a few incommensurate sines per axis.
class Shake {
 public:
  explicit Shake(Random& random);
  [[nodiscard]] double operator()(std::size_t axis, double t) const {
    return 0.5 * std::sin(4.1 * t + phase_[axis][0]) + 0.3 * std::sin(7.3 * t + phase_[axis][1]) +
           0.2 * std::sin(13.7 * t + phase_[axis][2]);
  }

 private:
  std::array<std::array<double, 3>, 6> phase_{};
};

/// Where the camera is and what it looks at.
struct View {
  Eigen::Vector3d eye, target;  ///< the middles of all paths but the loop [m]
  double radius;                ///< halfsphere, from the target [m]
  double azimuth;               ///< halfsphere, to either side [rad]
  double elevation, nod;        ///< halfsphere: mean, up and down [rad]
};

/// The view that shows most of a scenario.
[[nodiscard]] View view_of(const std::string& scenario);

/// T_w_c after `t` seconds. @param path  static, xyz, rpy, halfsphere or loop (in the middle of the room)
[[nodiscard]] SE3<double> camera_pose(const std::string& path, const View& view, double t,
                                      const Shake& shake);

}  // namespace dynslam::runtime::synth
