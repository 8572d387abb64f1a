// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <opencv2/core.hpp>

#include "dynslam/runtime/slam/last_view.hpp"
#include "slam/frame_state.hpp"

namespace dynslam::runtime {

/// What is kept of the last frame's images: a small view to align with and, where a keyframe may still be
/// made of it, its pyramid.
class LastImages {
 public:
  /// @param align  the view is kept at all
  LastImages(const ImageAlignmentOptions<double>& options, bool align) : view_(options), align_(align) {}

  /// @param moves         the dynamic pixels of the frame, CV_8UC1
  /// @param keep_pyramid  the frame may become a keyframe afterwards
  void remember(const FrameState& frame, const cv::Mat& moves, bool keep_pyramid);

  [[nodiscard]] bool can_align() const { return align_ && !view_.empty(); }
  /// The motion to another frame, see LastView::align(); not ok() where there is nothing to align with.
  [[nodiscard]] ImageAlignmentResult<double> align(const ImagePyramid& now, const AnyCamera<double>& camera,
                                                   const SE3<double>& predicted) {
    return can_align() ? view_.align(now, camera, predicted) : ImageAlignmentResult<double>();
  }
  [[nodiscard]] LastView& view() { return view_; }

  /// Empty where it was not kept.
  [[nodiscard]] const ImagePyramid& pyramid() const { return pyramid_; }
  void drop_pyramid() { pyramid_ = {}; }

 private:
  LastView view_;
  bool align_;
  ImagePyramid pyramid_;
};

}  // namespace dynslam::runtime
