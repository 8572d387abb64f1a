// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include "dynslam/features/descriptor.hpp"
#include "dynslam/features/feature.hpp"
#include "dynslam/features/feature_grid.hpp"
#include "dynslam/features/guided_match.hpp"
#include "dynslam/features/patch_matcher.hpp"
#include "dynslam/features/place_index.hpp"
#include "dynslam/geometry/any_camera.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/map/feature_frame.hpp"
#include "dynslam/map/keyframe_map.hpp"
#include "dynslam/map/loop_closer.hpp"
#include "dynslam/map/place_verifier.hpp"

/// The core's templates as the program uses them: geometry in double, any lens.
namespace dynslam::runtime {

/// An image's features and pose.
using Frame = dynslam::FeatureFrame<double>;
/// Keyframes and points, with the patches they are found by.
using LocalMap = KeyframeMap<double, PointPatch>;
/// A point of it.
using MapPoint = LocalMap::PointType;
/// A keyframe of it.
using Keyframe = LocalMap::KeyframeType;
/// Options of PlaceVerifier.
using PlaceOptions = dynslam::PlaceOptions<double>;
/// Recognises places.
using PlaceVerifier = dynslam::PlaceVerifier<Pinhole<double>, AnyCamera<double>>;
/// Options of LoopCloser.
using LoopOptions = dynslam::LoopOptions<double>;
/// A loop that was closed.
using LoopClosing = dynslam::LoopClosing<double>;
/// Closes loops.
using LoopCloser = dynslam::LoopCloser<Pinhole<double>, AnyCamera<double>>;

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
