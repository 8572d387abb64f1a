// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>

#include "dynslam/semantic/map_scan.hpp"

namespace dynslam::runtime {

/// What of an image becomes a scan.
using MapScanOptions = dynslam::MapScanOptions<float>;
/// A scan of a keyframe.
using MapScan = dynslam::MapScan<>;
/// Makes scans of images.
using MapScanner = dynslam::MapScanner<float>;

/// A CV_8UC3 matrix in OpenCV's order as an image of (red, green, blue). The matrix must outlive it.
struct BgrView {
  using Pixel = std::array<std::uint8_t, 3>;
  const cv::Mat& bgr;
  [[nodiscard]] int width() const { return bgr.cols; }
  [[nodiscard]] int height() const { return bgr.rows; }
  [[nodiscard]] Pixel operator()(int u, int v) const {
    const std::uint8_t* p = bgr.ptr<std::uint8_t>(v) + 3 * u;
    return {p[2], p[1], p[0]};
  }
};
static_assert(RgbImage<BgrView>);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
