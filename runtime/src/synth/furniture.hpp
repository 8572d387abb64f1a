// SPDX-License-Identifier: BSD-3-Clause
#pragma once

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
};

/// @param all_around  something to see on the side behind the usual cameras, too
[[nodiscard]] Furniture furnish(Random& random, const Textures& textures, bool all_around);

}  // namespace dynslam::runtime::synth
