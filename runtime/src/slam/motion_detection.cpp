// SPDX-License-Identifier: BSD-3-Clause
#include "slam/motion_detection.hpp"

#include <array>
#include <cstddef>
#include <utility>
#include <vector>

namespace dynslam::runtime {

void MotionDetection::begin(const FrameState& now) {
  segmenter_.segment(interop::view<const std::uint8_t>(now.input.gray), now.depth, now.input.t,
                     SE3<double>());
}

void MotionDetection::detect(const LocalMap& map, const LastFrame<double>& last,
                             const RollingShutter<double>& shutter, FrameState& now) {
  const SE3<double>& T_c_w = now.frame().T_c_w;
  if (segmenter_.has_reference()) segmenter_.place_reference(T_reference_keyframe_ * map.pose(keyframe_));
  segmenter_.set_depth_motion(last.depth_motion(now.time(), T_c_w * last.frame().T_c_w.inverse()));
  segmenter_.set_rolling_shutter(shutter);
  // What has most of the keypoints would be the measure of what is static.
  cv::Mat suspected = now.semantic;
  if (!now.foreground.empty()) suspected = suspected.empty() ? now.foreground : suspected | now.foreground;
  constexpr std::array kStages{Stage::lucas_kanade, Stage::residuals, Stage::free_space, Stage::growing};
  Stopwatch watch;
  const MotionResult<double>& motion = segmenter_.segment(
      interop::view<const std::uint8_t>(now.input.gray), now.depth, now.input.t, T_c_w,
      interop::view<const std::uint8_t>(std::as_const(suspected)),
      [&](MotionStage s) { now.result.times[kStages[static_cast<std::size_t>(s)]] = watch.lap_ms(); });
  // OpenCV has no read-only matrices.
  now.moving = cv::Mat(now.input.gray.size(), CV_8UC1, const_cast<std::uint8_t*>(motion.mask.data()));
  now.moving_widened = cv::countNonZero(now.moving) > 0 ? widened(now.moving, options_.margin) : now.moving;
}

void MotionDetection::set_reference(const LocalMap& map, const Frame& frame, const Placer& placer,
                                    std::span<const float> scales) {
  std::vector<ReferenceKeypoint<double>> keypoints;
  keypoints.reserve(frame.features.size());
  for (std::size_t i = 0; i < frame.features.size(); ++i) {
    const Feature& f = frame.features[i];
    keypoints.push_back({Eigen::Vector2d(f.u, f.v), placer.depth_of_row(f),
                         static_cast<double>(scales[static_cast<std::size_t>(f.octave)]),
                         frame.dynamic[i] != 0});
  }
  segmenter_.set_reference(keypoints, frame.T_c_w);
  keyframe_ = map.newest();
  T_reference_keyframe_ = frame.T_c_w * map.pose(keyframe_).inverse();
}

}  // namespace dynslam::runtime
