// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <concepts>

#include "dynslam/dynamics/depth_grid.hpp"
#include "dynslam/dynamics/keypoint_regions.hpp"
#include "dynslam/dynamics/locate_reference.hpp"
#include "dynslam/dynamics/motion_belief.hpp"
#include "dynslam/dynamics/motion_method.hpp"
#include "dynslam/dynamics/pose_check.hpp"
#include "dynslam/dynamics/reference_keyframe.hpp"
#include "dynslam/dynamics/static_weights.hpp"
#include "dynslam/features/corners.hpp"
#include "dynslam/segment/mask_completion.hpp"
#include "dynslam/segment/mask_growing.hpp"

namespace dynslam {

/// When the segmenter takes a new reference keyframe by itself.
struct OwnReferenceOptions {
  bool use = true;               ///< false: the host gives them (set_reference)
  double max_age = 0.7;          ///< views must differ, and still show the same things [s]
  double min_resting_found = 0.5;  ///< share of its keypoints at rest; with fewer found, a large thing that
                                   ///< it has no keypoints on has come into view
  int corners_per_keypoint = 4;  ///< that are looked at: many lie on edges of the depth and cannot serve
  CornerOptions corners;         ///< on the pyramid's level 1, where noise is halved
};

/// Options of MotionSegmenter.
template <std::floating_point S>
struct MotionSegmenterOptions {
  MotionMethod method = MotionMethod::full;
  ReferenceOptions reference;
  OwnReferenceOptions own_reference;
  LocateOptions<S> locating;
  PoseCheckOptions pose_check;
  StaticWeightsOptions<S> weights;
  DepthGridOptions grid;
  MotionBeliefOptions belief;     ///< MotionMethod::full
  KeypointRegionOptions regions;  ///< MotionMethod::paper
  MaskGrowingOptions growing;     ///< MotionMethod::paper
  UnmeasuredOptions unmeasured;
  /// By which the mask is widened, as a share of the image's width: a silhouette is known to a pixel or two
  /// only, and the grey image is taken some milliseconds before or after the depth image.
  double margin = 1 / 500.0;
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
