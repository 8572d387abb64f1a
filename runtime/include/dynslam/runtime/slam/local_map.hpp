// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/map/keyframe_map.hpp"
#include "dynslam/runtime/slam/frame.hpp"
#include "dynslam/runtime/slam/patch_matcher.hpp"

namespace dynslam::runtime {

using LocalMap = KeyframeMap<double, PointPatch>;
using MapPoint = LocalMap::PointType;
using Keyframe = LocalMap::KeyframeType;

}  // namespace dynslam::runtime
