// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "dynslam/map/masked_pose.hpp"
#include "slam/frame_state.hpp"
#include "slam/motion_detection.hpp"

namespace dynslam::runtime {

/// Options of StaticPose.
struct StaticPoseOptions {
  MaskArbitrationOptions<double> arbitration;
  int min_inliers = 25;        ///< fewer: the pose stays as it was
  int margin = 6;              ///< pixels around an a-priori mask in which features are not used
  double behind_mover = 0.05;  ///< of its distance: how far behind a moving surface a point is doubted
};

/// The pose of a tracked frame on what the fused mask leaves (paper, step 10), or on what is left by that
/// part of it which can be trusted; and what that means for the map's points.
class StaticPose {
 public:
  explicit StaticPose(const StaticPoseOptions& options) : options_(options) {}

  /// Optimises the pose again, after MotionDetection::detect(). Completes the frame's dynamic mask, flags
  /// features that must not make points, and counts in the map which points were matched on it.
  /// @param static_surfaces  255 where an a-priori mask is wrong; may be empty
  void optimise(const Evidence& from, const cv::Mat& static_surfaces, const MotionDetection& motion,
                PoseSolver& solver, FrameState& now);

  /// What a moving object showed before it was known to move is in the map, and there it stays where it was:
  /// the camera, once lost, would be found beside it when it is back. No wall can be where a moving object is
  /// or in front of it: a point that is expected there, and is not seen, went with it.
  void doubt_points(LocalMap& map, PoseSolver& solver, const FrameState& now) const;

 private:
  StaticPoseOptions options_;
  std::vector<std::vector<std::uint8_t>>
      masks_;  // flags of the features: the fused mask, the geometry's alone
  MaskedPoseWorkspace workspace_;
};

}  // namespace dynslam::runtime
