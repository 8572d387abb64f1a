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

namespace dynslam::runtime {

/// How a pose is found between two frames and proven by the local map. Lengths in metres, times in seconds.
struct PoseSearchOptions {
  int min_inliers = 25;          ///< fewer: the pose is not accepted
  int weak_inliers = 8;          ///< of the last frame's points: a start whose proof is the local map
  int sure_inliers = 50;         ///< of them: with fewer the local map is matched again from the pose it gave
  int settling_passes = 4;       ///< so often at most,
  double settling_growth = 1.1;  ///< and again only where the inliers became so many times as many
  double fallen_inliers =
      0.75;                  ///< share of the inliers of before, below which poses aside are tried; 0: never
  double usual_decay = 0.9;  ///< what the inliers of a frame count in the next, in that comparison
  double aside = 5;          ///< pixels by which what matches is aside from those poses
  int coasting_frames = 3;   ///< lost for fewer: the motion that was is tried before the places
  float near_radius = 12.0F,
        far_radius = 30.0F;  ///< of the search for the last frame's points [px of their level]
  double prior_share = 0.2;  ///< the predicted motion counts as this share of all matches
  double prior_speed = 0.9;  ///< standard deviation of the change of velocity between two frames [m/s]
  double prior_turn = 0.9;   ///< and of the angular velocity's [rad/s]
  double local_chi2 = 25;    ///< squared normalised error from which a match of the local map is dropped
  int candidates = 5;        ///< keyframes tried per lost frame
  double max_speed = 4;      ///< of a hand [m/s]: farther, a place that looks right is another one
  double max_turn = 8;       ///< [rad/s]
  /// How well the motion between frames tells the camera's turn while it reads its rows, a standard deviation
  /// [rad/s]; 0: it is taken for it. A hand's is ten times as large, but matches err together (lens, map),
  /// and a turn that is free takes the map's errors up: people 8.3 mm with 0.3, 5.3 with this, 6.0 with 0.
  double turn_doubt = 0.02;
  bool revise = true;  ///< place a frame once more by the motion that the next one tells; rolling shutters
  std::size_t young_frames = 10;  ///< of a map, in which what lies behind is asked, too; 0: never
  /// Of a pose's matches on what stands before the room, up to which it is not asked: 0.58 of those of a pose
  /// that goes with a board, 0.16 at most of one that does not.
  double foreground_share = 0.25;
  /// A loss of so many frames at most is gone through once more when the camera is known on both sides of it;
  /// 0: never. Their images are kept meanwhile (2.2 MB each at 640x480).
  std::size_t recovered_frames = 20;
  /// How far beside where the motion on both sides leads such a pose may be, by the time to the nearest one
  /// that is known [m/s, rad/s].
  double recovered_speed = 0.5;
  int recovered_inliers = 12;   ///< of such a pose: fewer than without that bound, for it says most already
  double longest_delay = 0.05;  ///< of a depth image, over which the velocity is trusted [s]

  /// Between two frames, below which they tell how the camera moved while they were taken [s].
  [[nodiscard]] double longest_motion() const { return 4 * longest_delay; }
};

/// Options of Tracker.
struct TrackerOptions {
  DynamicsMode dynamics = DynamicsMode::both;
  Method method = Method::full;
  std::optional<Additions> additions;  ///< empty: as method and mode have them
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
  double behind_mover = 0.05;    ///< of its distance: how far behind a mover's surface a point is doubted
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
  int reference_distance = 5;       ///< keyframes between the present one and the reference (paper, step 4)
};

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
