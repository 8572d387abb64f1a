// SPDX-License-Identifier: BSD-3-Clause
// What the synthetic office is built of: flat sides, boxes and limbs.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <vector>

#include "dynslam/runtime/masks.hpp"

namespace dynslam::runtime::synth {

/// What a surface belongs to.
struct Tag {
  Label label = Label::background;
  std::uint16_t instance = 0;  ///< 0: none
  bool dynamic = false, box = false;
};

struct Triangle {
  std::array<Eigen::Vector3d, 3> p;   ///< world [m]
  std::array<Eigen::Vector2d, 3> uv;  ///< metres on the surface
  Eigen::Vector3d normal;
  int texture = 0;
  Label label = Label::background;
  std::uint16_t instance = 0;  ///< 0: none
  bool dynamic = false, box = false;
};

/// A place on the floor plan, turned by `yaw` radians. World: x right, y forward, z up.
[[nodiscard]] inline Eigen::Affine3d at(double x, double y, double z, double yaw = 0) {
  return Eigen::Translation3d(x, y, z) * Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ());
}

/// Appends a flat side with the corners `p`, lower left first and counterclockwise.
void quad(std::vector<Triangle>& out, const std::array<Eigen::Vector3d, 4>& p, int texture, const Tag& tag);
/// Appends a box about the origin of `T`. @param front  texture of the side towards -y; -1: as the others
void box(std::vector<Triangle>& out, const Eigen::Affine3d& T, const Eigen::Vector3d& size, int texture,
         const Tag& tag, int front = -1);
/// Appends a capsule from `a` to `b` with the radii `ra` and `rb` [m].
void limb(std::vector<Triangle>& out, const Eigen::Vector3d& a, const Eigen::Vector3d& b, double ra,
          double rb, int texture, const Tag& tag);

}  // namespace dynslam::runtime::synth
