// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstdint>
#include <opencv2/core.hpp>

#include "dynslam/geometry/any_camera.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/image/image_view.hpp"
#include "dynslam/image/pyramid.hpp"
#include "dynslam/optim/image_alignment.hpp"
#include "dynslam/runtime/slam/image_pyramid.hpp"

namespace dynslam::runtime {

/// The last frame's image and depth, small and without what moved in it, from which direct alignment finds
/// the camera's motion where features do not.
class LastView {
 public:
  explicit LastView(const ImageAlignmentOptions<double>& options) : options_(options) {}

  [[nodiscard]] bool empty() const { return images_.size() == 0; }

  /// @param pyramid  of the frame; its smallest level is kept
  /// @param mask, moving  what moved, CV_8UC1; `moving` may be empty
  void remember(const ImagePyramid& pyramid, const ImageView<const float>& depth, const cv::Mat& mask,
                const cv::Mat& moving);

  /// The motion from there to another frame.
  /// @param predicted  T_now_last; no motion at all is tried, too
  [[nodiscard]] ImageAlignmentResult<double> align(const ImagePyramid& now, const AnyCamera<double>& camera,
                                                   const SE3<double>& predicted);

  /// The same by what is behind in the other frame alone.
  /// @param depth, foreground  of that frame; CV_8UC1, nonzero: not behind
  [[nodiscard]] ImageAlignmentResult<double> align_behind(const ImagePyramid& now,
                                                          const ImageView<const float>& depth,
                                                          const cv::Mat& foreground,
                                                          const AnyCamera<double>& camera,
                                                          const SE3<double>& predicted);

 private:
  HalvingPyramid<std::uint8_t> images_, now_;
  Image<float> depth_, depth_behind_;  // of the size of the largest image
  cv::Mat moved_;                      // likewise
  ImageAlignmentOptions<double> options_;
  ImageAlignmentWorkspace<double> workspace_;
};

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
