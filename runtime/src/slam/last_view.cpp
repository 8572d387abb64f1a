// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/last_view.hpp"

#include <array>
#include <opencv2/imgproc.hpp>
#include <span>

namespace dynslam::runtime {
namespace {

constexpr int kLevels = 8;  // as many as there is room for

}  // namespace

void LastView::remember(const ImagePyramid& pyramid, const ImageView<const float>& depth, const cv::Mat& mask,
                        const cv::Mat& moving) {
  const int smallest = pyramid.size() - 1;
  images_.build(pyramid.image(smallest), kLevels, pyramid.scale(smallest));
  const cv::Size size = pyramid.levels.back().size();
  // The rim, too: where it is off by a pixel the gradients are those of what moved.
  cv::resize(mask, moved_, size, 0, 0, cv::INTER_NEAREST);
  if (!moving.empty()) {
    cv::Mat small;
    cv::resize(moving, small, size, 0, 0, cv::INTER_NEAREST);
    cv::bitwise_or(moved_, small, moved_);
  }
  cv::dilate(moved_, moved_, cv::Mat());
  depth_.resize(size.width, size.height);
  for (int v = 0; v < size.height; ++v) {
    const float* row = depth.row((2 * v + 1) * depth.height() / (2 * size.height));
    const std::uint8_t* moved = moved_.ptr(v);
    for (int u = 0; u < size.width; ++u)
      depth_(u, v) = moved[u] != 0 ? 0.0F : row[(2 * u + 1) * depth.width() / (2 * size.width)];
  }
}

ImageAlignmentResult<double> LastView::align(const ImagePyramid& now, const AnyCamera<double>& camera,
                                             const SE3<double>& predicted) {
  const int smallest = now.size() - 1;
  now_.build(now.image(smallest), kLevels, now.scale(smallest));
  const std::array<SE3<double>, 2> starts{predicted, SE3<double>()};
  return align_images<double>(images_, depth_, now_, camera, std::span<const SE3<double>>(starts), options_,
                              workspace_);
}

}  // namespace dynslam::runtime
