// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstdint>
#include <optional>
#include <string_view>

#include "dynslam/dynamics/mask_arbitration.hpp"
#include "dynslam/dynamics/motion_segmenter.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/map/covering_keyframe.hpp"
#include "dynslam/map/keyframe_policy.hpp"
#include "dynslam/map/local_matcher.hpp"
#include "dynslam/map/matched_pose.hpp"
#include "dynslam/map/point_maker.hpp"
#include "dynslam/optim/image_alignment.hpp"
#include "dynslam/runtime/slam/dynamics_mode.hpp"
#include "dynslam/runtime/slam/feature_extractor.hpp"
#include "dynslam/runtime/slam/local_bundle.hpp"
#include "dynslam/runtime/slam/types.hpp"
#include "dynslam/track/pose_tracking_options.hpp"

namespace dynslam::runtime {

/// How poses are searched.
using PoseSearchOptions = PoseTrackingOptions<double>;

/// Options of Tracker.
struct TrackerOptions {
  DynamicsMode dynamics = DynamicsMode::both;
  MotionMethod method = MotionMethod::full;
  Additions additions = Additions::by_mode;  ///< to the paper's search for a pose
  FeatureOptions features;
  MotionSegmenterOptions<double> geometry;  ///< its method is the one above
  std::uint64_t seed = 1;                   ///< of the consensus
  /// Sensor noise, and the time between colour and depth image; goes for `pose` and `points`, too.
  DepthNoise<double> depth_noise{0.004, 0.008};
  int initial_features = 100;  ///< with depth, to start a map
  PoseSearchOptions search;
  ImageAlignmentOptions<double> alignment;  ///< with the last frame, where features are too few
  LocalMatchOptions<double> matching;
  MatchedPoseOptions<double> pose;
  PointMakerOptions<double> points;
  KeyframeOptions<double> keyframes;
  CoverageOptions<double> coverage;  ///< when a keyframe of the map serves instead of a new one
  MaskArbitrationOptions<double> arbitration;
  int semantic_dilation = 9;     ///< pixels added around a-priori masks
  int feature_margin = 6;        ///< pixels around the fused mask in which features are not used
  bool bundle = true;            ///< adjust the newest keyframes and their points
  int bundle_delay = 4;          ///< frames after which the adjustment's result is waited for and used
  LocalBundleOptions local_bundle;
  bool close_loops = true;
  int loop_bundle_window = 60;  ///< keyframes adjusted after a loop
  int loop_bundle_delay = 12;   ///< frames after which that is waited for
  LoopOptions loops;
  PlaceOptions relocalisation;
  double redundant_keyframe = 0.9;  ///< of its points seen by three others: a keyframe goes
  int spare_keyframes = 5;          ///< newest keyframes, which never go
  int reference_distance = 5;       ///< keyframes between the present one and the reference (paper, Sec. 3.2)
};

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
