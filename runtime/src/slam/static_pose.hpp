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
};

/// The pose of a tracked frame on what the fused mask leaves, or on what is left by that
/// part of it which can be trusted; and what that means for the map's points.
class StaticPose {
 public:
  explicit StaticPose(const StaticPoseOptions& options) : options_(options) {}

  /// Optimises the pose again, after MotionDetection::detect(). Completes the frame's dynamic mask, flags
  /// features that must not make points, and counts in the map which points were matched on it.
  /// @param static_surfaces  255 where an a-priori mask is wrong; may be empty
  void optimise(const Evidence& from, const cv::Mat& static_surfaces, const MotionDetection& motion,
                PoseSolver& solver, FrameState& now);

 private:
  StaticPoseOptions options_;
  std::vector<std::vector<std::uint8_t>>
      masks_;  // flags of the features: the fused mask, the geometry's alone
  MaskedPoseWorkspace workspace_;
};

}  // namespace dynslam::runtime
