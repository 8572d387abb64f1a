// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "dynslam/runtime/slam/types.hpp"

namespace dynslam::runtime {

/// Takes out of a map what a later session has no use for: bad points, and culled keyframes by which nothing
/// is placed, so that a map that is saved again and again does not grow by the number of sessions.
/// @param scanned  ids of the keyframes that scans are placed by
/// @return per keyframe its new id, -1: dropped
std::vector<int> tidy_map(LocalMap& map, const std::vector<int>& scanned);

}  // namespace dynslam::runtime
