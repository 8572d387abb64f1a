// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <span>

#include "dynslam/dynamics/motion_segmenter.hpp"
#include "dynslam/features/feature_placer.hpp"
#include "slam/frame_state.hpp"

namespace dynslam::runtime {

/// Options of MotionDetection.
struct MotionDetectionOptions {
  MotionSegmenterOptions<double> segmenter;
  int reference_distance = 5;  ///< keyframes between the present one and the reference (paper, Sec. 3.2)
  int margin = 6;              ///< pixels around what moves in which features are not used
};

/// Finds what moves in a tracked frame by geometry, against a frame beside a keyframe of the map.
class MotionDetection {
 public:
  using Segmenter = MotionSegmenter<double, AnyCamera<double>>;
  using Placer = FeaturePlacer<AnyCamera<double>>;

  MotionDetection(const AnyCamera<double>& camera, const MotionDetectionOptions& options)
      : options_(options), segmenter_(camera, options.segmenter) {}

  /// Takes the images of a map's first frame, which there is nothing to compare with.
  void begin(const FrameState& now);
  /// Sets now.moving and now.moving_widened, by the frame's pose and the motion that its features are placed
  /// by.
  void detect(const LocalMap& map, const LastFrame<double>& last, const RollingShutter<double>& shutter,
              FrameState& now);
  /// What was found to move in a frame in the end, evidence for later frames. @param moves  CV_8UC1
  void remember(const SE3<double>& T_c_w, const cv::Mat& moves) {
    segmenter_.remember(T_c_w, interop::view<const std::uint8_t>(moves));
  }

  /// Whether a frame that was kept is to be the reference.
  [[nodiscard]] bool wants_reference(const LocalMap& map) const {
    return !segmenter_.has_reference() || map.newest() - keyframe_ > options_.reference_distance;
  }
  /// Whether the reference is of no use any more: any frame is to be it.
  [[nodiscard]] bool reference_stale() const { return segmenter_.reference_stale(); }
  /// @param placer  by which the frame's features were placed
  /// @param scales  of the pyramid levels on which features are found
  void set_reference(const LocalMap& map, const Frame& frame, const Placer& placer,
                     std::span<const float> scales);

  /// The map was corrected: new T_c_w = old T_c_w D.
  void follow(const SE3<double>& D) { segmenter_.follow(D); }
  /// Of the frame at hand: the surface at a recorded pixel was seen in the same place long before.
  [[nodiscard]] bool verified_static(float u, float v) const { return segmenter_.verified_static(u, v); }
  [[nodiscard]] Segmenter& segmenter() { return segmenter_; }
  [[nodiscard]] const MotionResult<double>& motion() const { return segmenter_.motion(); }

 private:
  MotionDetectionOptions options_;
  Segmenter segmenter_;
  int keyframe_ = 0;                  // beside which the reference stands
  SE3<double> T_reference_keyframe_;  // and how
};

}  // namespace dynslam::runtime
