// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/last_view.hpp"

#include <array>
#include <opencv2/imgproc.hpp>
#include <span>

namespace dynslam::runtime {
namespace {

constexpr int kLevels = 8;  // as many as there is room for

/// Depth at the places of the pixels of a smaller image; 0 where that is masked.
void reduce(const ImageView<const float>& depth, const cv::Mat& mask, Image<float>& out) {
  out.resize(mask.cols, mask.rows);
  for (int v = 0; v < mask.rows; ++v) {
    const float* row = depth.row((2 * v + 1) * depth.height() / (2 * mask.rows));
    const std::uint8_t* masked = mask.ptr(v);
    for (int u = 0; u < mask.cols; ++u)
      out(u, v) = masked[u] != 0 ? 0.0F : row[(2 * u + 1) * depth.width() / (2 * mask.cols)];
  }
}

/// Goes on halving where a pyramid ends.
void build(const ImagePyramid& pyramid, HalvingPyramid<std::uint8_t>& out) {
  const int smallest = pyramid.size() - 1;
  out.build(pyramid.image(smallest), kLevels, pyramid.scale(smallest));
}

}  // namespace

void LastView::remember(const ImagePyramid& pyramid, const ImageView<const float>& depth, const cv::Mat& mask,
                        const cv::Mat& moving) {
  build(pyramid, images_);
  const cv::Size size = pyramid.levels.back().size();
  // The rim, too: where it is off by a pixel the gradients are those of what moved.
  cv::resize(mask, moved_, size, 0, 0, cv::INTER_NEAREST);
  if (!moving.empty()) {
    cv::Mat small;
    cv::resize(moving, small, size, 0, 0, cv::INTER_NEAREST);
    cv::bitwise_or(moved_, small, moved_);
  }
  cv::dilate(moved_, moved_, cv::Mat());
  reduce(depth, moved_, depth_);
}

ImageAlignmentResult<double> LastView::align(const ImagePyramid& now, const AnyCamera<double>& camera,
                                             const SE3<double>& predicted) {
  build(now, now_);
  const std::array<SE3<double>, 2> starts{predicted, SE3<double>()};
  return align_images<double>(images_, depth_, now_, camera, std::span<const SE3<double>>(starts), options_,
                              workspace_);
}

ImageAlignmentResult<double> LastView::align_behind(const ImagePyramid& now,
                                                    const ImageView<const float>& depth,
                                                    const cv::Mat& foreground,
                                                    const AnyCamera<double>& camera,
                                                    const SE3<double>& predicted) {
  build(now, now_);
  cv::Mat small;
  cv::resize(foreground, small, now.levels.back().size(), 0, 0, cv::INTER_NEAREST);
  cv::dilate(small, small, cv::Mat());
  reduce(depth, small, depth_behind_);
  const std::array<SE3<double>, 2> starts{predicted.inverse(), SE3<double>()};
  auto result = align_images<double>(now_, depth_behind_, images_, camera,
                                     std::span<const SE3<double>>(starts), options_, workspace_);
  result.T_image_reference = result.T_image_reference.inverse();
  return result;
}

}  // namespace dynslam::runtime
