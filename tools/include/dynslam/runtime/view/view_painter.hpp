// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <memory>
#include <opencv2/core.hpp>
#include <string>

#include "dynslam/runtime/view/view_scene.hpp"

namespace dynslam::runtime {

/// What a view has, and what its legend names.
struct PainterOptions {
  cv::Size image{640, 480};  ///< of the camera [px]
  DynamicsMode dynamics = DynamicsMode::both;
  bool map = true;    ///< there is a map to be shown
  bool truth = true;  ///< there is a ground truth
};

/// Where a view has what [px].
struct ViewLayout {
  cv::Size canvas;
  cv::Rect header;           ///< frame number and state
  cv::Rect picture;          ///< the colour image, with `scale` canvas pixels for one of its own
  double scale = 1;          ///< 1 for images 480 to 960 pixels wide
  cv::Rect trajectory, map;  ///< from above; `map` is empty without one
  cv::Rect footer;           ///< what the colours mean
};
/// A layout that fits a screen of 1366 x 768 for images of any size.
[[nodiscard]] ViewLayout view_layout(const PainterOptions& options);

/// The colour of a static weight, as a report has it: red (moves) over yellow to blue (static), BGR.
[[nodiscard]] cv::Scalar weight_colour(double weight);
/// What stands at the top of a view: "frame 12 of 300, 0.37 s".
[[nodiscard]] std::string frame_text(const ViewFrame& frame);
/// "tracked, keyframe", "relocalised", "lost", or "paused" beside it.
[[nodiscard]] std::string state_text(const ViewScene& scene);

/// Draws a run as it goes on: the frame with masks and keypoints, the trajectory and the map from above. It
/// needs no display.
class ViewPainter {
 public:
  /// @throws UsageError for an image without pixels
  explicit ViewPainter(const PainterOptions& options);
  ~ViewPainter();
  ViewPainter(const ViewPainter&) = delete;
  ViewPainter& operator=(const ViewPainter&) = delete;

  /// The picture, CV_8UC3, of view_layout()'s size; valid until the next call.
  /// @throws UsageError for an image or a mask of another size or type
  const cv::Mat& paint(const ViewScene& scene);
  [[nodiscard]] const ViewLayout& layout() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
