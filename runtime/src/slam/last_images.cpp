// SPDX-License-Identifier: BSD-3-Clause
#include "slam/last_images.hpp"

namespace dynslam::runtime {

void LastImages::remember(const FrameState& frame, const cv::Mat& moves, bool keep_pyramid) {
  const ImagePyramid& pyramid = frame.image->pyramid;
  if (align_) view_.remember(pyramid, frame.depth, moves, frame.moving);
  if (!keep_pyramid) return;
  cv::Mat own = pyramid_.levels.empty() ? cv::Mat() : pyramid_.levels.front();
  pyramid.levels.front().copyTo(own);  // level 0 may be the caller's
  pyramid_ = pyramid;
  pyramid_.levels.front() = own;
}

}  // namespace dynslam::runtime
