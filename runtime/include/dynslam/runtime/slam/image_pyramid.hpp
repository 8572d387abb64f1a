// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "dynslam/image/pyramid.hpp"
#include "dynslam/interop/opencv.hpp"

namespace dynslam::runtime {

/// Reduced copies of an image. Pixel centres are at integers on every level.
struct ImagePyramid {
  std::vector<cv::Mat> levels;              ///< CV_8UC1, level 0 is the image
  std::vector<Eigen::Vector2d> pixel_size;  ///< of each level, in pixels of level 0

  [[nodiscard]] int size() const { return static_cast<int>(levels.size()); }
  [[nodiscard]] ImageView<const std::uint8_t> image(int level) const {
    return interop::view<const std::uint8_t>(levels[static_cast<std::size_t>(level)]);
  }
  [[nodiscard]] const Eigen::Vector2d& scale(int level) const {
    return pixel_size[static_cast<std::size_t>(level)];
  }
  [[nodiscard]] Eigen::Vector2d to_base(const Eigen::Vector2d& x, int level) const {
    return dynslam::to_base<double>(*this, x, level);
  }
};

static_assert(ImagePyramidLike<ImagePyramid>);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
