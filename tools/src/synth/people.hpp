// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <vector>

#include "synth/furniture.hpp"
#include "synth/random.hpp"
#include "synth/solids.hpp"
#include "synth/textures.hpp"

namespace dynslam::runtime::synth {

struct Looks {
  double height;  ///< metres
  int shirt, trousers, skin, hair;
  std::uint16_t instance;
};

/// Joints of a body of 1.75 m: forward, left and up of the floor below it [m].
struct Leg {
  Eigen::Vector3d hip, knee, ankle, toe;
};
struct Arm {
  Eigen::Vector3d shoulder, elbow, hand;
};
struct Posture {
  std::array<Leg, 2> legs;  ///< right, left
  std::array<Arm, 2> arms;  ///< right, left
};

/// Somebody who walks to and fro in front of the desks.
struct Walker {
  double x0, y;  ///< where the way begins [m]
  double speed;  ///< m/s, negative: to the left at first
  double phase;  ///< of the steps [rad]
  Looks looks;
  double range;  ///< half the length of the way [m]
  bool carries;  ///< a box
};

/// @param k  the how manieth
[[nodiscard]] Looks make_looks(Random& random, const Textures& textures, int k, std::uint16_t instance);
/// Appends a person who stands or walks. @param T  from the frame of the posture to the world, with the scale
void add_person(std::vector<Triangle>& out, const Textures& textures, const Looks& looks,
                const Eigen::Affine3d& T, const Posture& posture);
/// An arm that hangs, `angle` radians before the body. @param side  -1 right, 1 left
[[nodiscard]] Arm hanging_arm(double side, double angle);

/// @param k  the how manieth
[[nodiscard]] Walker make_walker(Random& random, const Textures& textures, int k, std::uint16_t instance,
                                 bool carries);
/// Appends a walker `t` seconds after the start.
void add_walker(std::vector<Triangle>& out, const Textures& textures, const Walker& walker, double t);
/// Appends a person on a chair at (x, y), who moves as little as one does there.
void add_sitter(std::vector<Triangle>& out, const Textures& textures, double x, double y,
                std::uint16_t instance, double t);

}  // namespace dynslam::runtime::synth
