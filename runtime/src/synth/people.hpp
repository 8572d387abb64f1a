// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "synth/furniture.hpp"
#include "synth/random.hpp"
#include "synth/solids.hpp"
#include "synth/textures.hpp"

namespace dynslam::runtime::synth {

/// Somebody who walks to and fro in front of the desks.
struct Walker {
  double x0, y;          ///< where the way begins [m]
  double speed;          ///< m/s, negative: to the left at first
  double phase, height;  ///< of the steps [rad]; metres
  double range;          ///< half the length of the way [m]
  int shirt, trousers, skin, hair;
  std::uint16_t instance;
  bool carries;  ///< a box
};

/// @param k  the how manieth
[[nodiscard]] Walker make_walker(Random& random, const Textures& textures, int k, std::uint16_t instance,
                                 bool carries);
/// Appends a walker `t` seconds after the start.
void add_walker(std::vector<Triangle>& out, const Textures& textures, const Walker& walker, double t);
/// Appends somebody on a chair at (x, y), who moves as little as one does there.
void add_sitter(std::vector<Triangle>& out, const Textures& textures, double x, double y,
                std::uint16_t instance, double t);

}  // namespace dynslam::runtime::synth
