// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/features/descriptor.hpp"
#include "dynslam/features/feature.hpp"
#include "dynslam/features/feature_grid.hpp"
#include "dynslam/features/guided_match.hpp"
#include "dynslam/features/multi_index.hpp"
#include "dynslam/features/patch_matcher.hpp"
#include "dynslam/geometry/any_camera.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/map/frame.hpp"
#include "dynslam/map/keyframe_map.hpp"
#include "dynslam/map/loop_closer.hpp"
#include "dynslam/map/place_verifier.hpp"

/// The core's templates as the program uses them: geometry in double, any lens.
namespace dynslam::runtime {

using Frame = dynslam::Frame<double>;
using LocalMap = KeyframeMap<double, PointPatch>;
using MapPoint = LocalMap::PointType;
using Keyframe = LocalMap::KeyframeType;
using PlaceOptions = dynslam::PlaceOptions<double>;
using PlaceVerifier = dynslam::PlaceVerifier<Pinhole<double>, AnyCamera<double>>;
using LoopOptions = dynslam::LoopOptions<double>;
using LoopClosing = dynslam::LoopClosing<double>;
using LoopCloser = dynslam::LoopCloser<Pinhole<double>, AnyCamera<double>>;

}  // namespace dynslam::runtime
