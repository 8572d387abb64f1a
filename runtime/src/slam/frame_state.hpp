// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "dynslam/features/masked_features.hpp"
#include "dynslam/image/image_view.hpp"
#include "dynslam/interop/opencv.hpp"
#include "dynslam/runtime/frame.hpp"
#include "dynslam/runtime/masks.hpp"
#include "dynslam/runtime/slam/feature_extractor.hpp"
#include "dynslam/runtime/slam/image_pyramid.hpp"
#include "dynslam/runtime/slam/track_result.hpp"
#include "dynslam/runtime/slam/types.hpp"
#include "dynslam/runtime/stopwatch.hpp"
#include "dynslam/track/local_map_pose.hpp"
#include "dynslam/track/pose_search.hpp"

namespace dynslam::runtime {

/// What matches frames with the map and optimises their poses.
using PoseSolver = LocalMapPose<AnyCamera<double>>;
/// What the pose of a frame is found from.
using Evidence = PoseEvidence<LocalMap, ImagePyramid, ImageView<const float>>;

/// The frame at hand, and what is known of it so far.
struct FrameState {
  explicit FrameState(const RgbdFrame& frame_input)
      : input(frame_input), depth(interop::view<const float>(frame_input.depth)) {}

  const RgbdFrame& input;
  ImageView<const float> depth;
  std::shared_ptr<const ImageFeatures> image;
  SearchedFrame<double> pose;
  const Masks* prior = nullptr;   // where it is used
  cv::Mat semantic;               // a-priori mask with its margin; empty: none that is trusted
  bool mask_covers_view = false;  // it leaves next to nothing
  cv::Mat foreground;             // CV_8UC1, where the pose was found to follow it; else empty
  cv::Mat moving;                 // what the geometry found, in the depth image
  cv::Mat moving_widened;         // with its margin
  std::optional<int> keyframe;    // that it became
  TrackResult result;
  Stopwatch whole, watch;

  [[nodiscard]] Frame& frame() { return pose.frame; }
  [[nodiscard]] const Frame& frame() const { return pose.frame; }
  [[nodiscard]] FrameTime time() const { return {input.t, input.depth_delay, input.ns}; }
  /// What its pose is found from. Valid while the frame and `left_out` are not changed.
  /// @param left_out  CV_8UC1, nonzero: what patches find there is not used; may be empty
  [[nodiscard]] Evidence evidence(LocalMap& map, const LastFrame<double>& last,
                                  const cv::Mat& left_out) const {
    return {map, last, image->pyramid, depth, time(), interop::view<const std::uint8_t>(left_out)};
  }
  /// The same without what an a-priori mask covers that leaves next to nothing: patches are found beside the
  /// corners that were flagged, and would be all that there is. Under other masks they are used, few as they
  /// are.
  [[nodiscard]] Evidence evidence(LocalMap& map, const LastFrame<double>& last) const {
    return evidence(map, last, covering_mask());
  }
  [[nodiscard]] const cv::Mat& covering_mask() const {
    static const cv::Mat none;
    return mask_covers_view ? semantic : none;
  }

  void done(Stage stage, double before_ms = 0) { result.times[stage] = watch.lap_ms() + before_ms; }
  TrackResult finish() {
    result.inliers = pose.inliers;
    result.covariance = pose.covariance;
    result.times[Stage::tracking] = whole.lap_ms();
    return std::move(result);
  }
};

/// A mask with `margin` pixels added around what it shows.
inline cv::Mat widened(const cv::Mat& mask, int margin) {
  const int size = 2 * margin + 1;
  cv::Mat result;
  cv::dilate(mask, result, cv::getStructuringElement(cv::MORPH_RECT, {size, size}));
  return result;
}

/// Of what moves and what only may, what moves (255).
inline cv::Mat moves_now(const TrackResult& result) {
  return result.dynamic_mask == kMovesNow;
}

/// Flags, beside those that are set, the features of a frame that lie on a mask.
inline void flag(const Frame& frame, const cv::Mat& mask, std::vector<std::uint8_t>& flags) {
  flags.resize(frame.features.size(), 0);
  flag_masked(interop::view<const std::uint8_t>(mask), frame.features, flags);
}

}  // namespace dynslam::runtime
