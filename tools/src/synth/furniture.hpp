// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "synth/random.hpp"
#include "synth/solids.hpp"
#include "synth/textures.hpp"

namespace dynslam::runtime::synth {

/// The room and what stands in it.
struct Furniture {
  std::vector<Triangle> triangles;
  std::uint16_t instances = 0;        ///< chairs and displays
  double sitter_x = 0, sitter_y = 0;  ///< the chair that is taken [m]
  Eigen::AlignedBox3d counter;        ///< as high as a hand; empty without an aisle
};

struct FurnishOptions {
  bool all_around = false;  ///< something to see on the side behind the usual cameras, too
  bool aisle = false;       ///< chairs stand close to the desks, a counter at the free floor before them
};

[[nodiscard]] Furniture furnish(Random& random, const Textures& textures, const FurnishOptions& options);
/// Appends an office chair. @param T  of its middle on the floor; who sits on it looks along +y
void add_chair(std::vector<Triangle>& out, const Textures& textures, const Eigen::Affine3d& T,
               const Tag& tag);

}  // namespace dynslam::runtime::synth
