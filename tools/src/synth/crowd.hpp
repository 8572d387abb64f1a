// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "synth/people.hpp"
#include "synth/random.hpp"
#include "synth/solids.hpp"
#include "synth/textures.hpp"

namespace dynslam::runtime::synth {

/// Where a person stands at an instant; between two stops one moves smoothly.
struct Stop {
  double t;        ///< s after the begin of the round
  double x;        ///< m
  double heading;  ///< rad, 0: along x
  double grip;     ///< 1: the hands are on the chair
  double chair_x;  ///< m; the pushed chair
};

/// Somebody who goes along x, round after round, and sets the feet down on the floor.
struct Passer {
  Looks looks;
  double y;      ///< m
  double step;   ///< m; divides the distances between stops
  double start;  ///< s into the round when the sequence begins
  std::vector<Stop> round;
};

/// People who walk along a counter with a hand on it, and one who pushes a chair across the floor and pulls
/// it back.
class Crowd {
 public:
  /// @param counter    that the walkers touch
  /// @param instances  how many there are; those of the crowd are added
  Crowd(Random& random, const Textures& textures, const Eigen::AlignedBox3d& counter, int walkers,
        std::uint16_t& instances);
  /// Appends everybody and the chair `t` seconds after the start.
  void add(std::vector<Triangle>& out, const Textures& textures, double t) const;

 private:
  Eigen::AlignedBox3d counter_;
  std::vector<Passer> walkers_;
  Passer pusher_;
  std::uint16_t chair_ = 0;
};

}  // namespace dynslam::runtime::synth
