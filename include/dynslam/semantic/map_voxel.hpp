// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstdint>

#include "dynslam/semantic/log_odds.hpp"

namespace dynslam {

/// What a map knows of a cell. Label and confidence mean something where it is occupied.
struct MapVoxel {
  Occupancy state = Occupancy::unknown;
  float log_odds = 0;
  std::uint8_t label = 0;
  float confidence = 0;  ///< share of the votes that the label has, 0 to 1
  bool operator==(const MapVoxel&) const = default;
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
