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
#include "dynslam/runtime/slam/tracker.hpp"
#include "dynslam/runtime/stopwatch.hpp"

namespace dynslam::runtime {

/// The frame at hand, and what is known of it so far.
struct Tracker::Present {
  explicit Present(const RgbdFrame& frame_input)
      : input(frame_input), depth(interop::view<const float>(frame_input.depth)) {}

  const RgbdFrame& input;
  ImageView<const float> depth;
  std::shared_ptr<const ImageFeatures> image;
  Frame frame;
  SE3<double> T_c_w;
  Eigen::Vector3d turn =
      Eigen::Vector3d::Zero();  // while the rows are read, beyond the motion since the last frame
  std::optional<ImageAlignmentResult<double>> aligned;  // with the last frame; empty: not tried
  cv::Mat left_out;              // what shall not tell the pose for now, CV_8UC1; empty: nothing
  bool plain = false;            // located without what the method adds
  const Masks* prior = nullptr;  // where it is used
  cv::Mat semantic;              // a-priori mask with its margin; empty: none that is believed
  bool covers_view = false;      // it leaves next to nothing
  cv::Mat foreground;            // CV_8UC1, where the pose was found to follow it; else empty
  cv::Mat moving;                // what the geometry found, in the depth image
  cv::Mat moving_widened;        // with its margin
  TrackResult result;
  Stopwatch whole, watch;

  void done(Stage stage, double before_ms = 0) { result.times[stage] = watch.lap_ms() + before_ms; }
  TrackResult finish() {
    result.times[Stage::tracking] = whole.lap_ms();
    return std::move(result);
  }
};

/// A pose of the frame at hand, and what was matched for it.
struct Tracker::Attempt {
  Frame frame;
  TrackResult result;
  SE3<double> T_c_w;
  Eigen::Vector3d turn;
  RollingShutter<double> shutter;
};

/// A frame that was lost.
struct Tracker::Lost {
  double t, depth_delay;
  std::int64_t ns;
  cv::Mat depth;                               // a copy
  std::shared_ptr<const ImageFeatures> image;  // with an image of its own
  Frame frame;                                 // with its extracted features alone
  std::optional<PoseResult<double>> pose;      // what was found since
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
