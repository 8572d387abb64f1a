// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <string>

namespace dynslam::runtime {

struct ImageFeatures;  // of slam/feature_extractor.hpp, which the readers do not know

/// A frame in memory, ready for tracking.
struct RgbdFrame {
  std::size_t index = 0;   ///< in the sequence, broken frames counted; the tracker counts for itself
  double t = 0;            ///< colour time [s]
  std::int64_t ns = 0;     ///< the same in nanoseconds, as it was recorded; 0: unknown
  double depth_delay = 0;  ///< depth time less colour time [s]
  std::string stamp;
  cv::Mat bgr;    ///< CV_8UC3
  cv::Mat gray;   ///< CV_8UC1
  cv::Mat depth;  ///< CV_32FC1 metres, NaN = invalid
  // What FramePreparation adds; empty where it was not asked.
  std::shared_ptr<const ImageFeatures> features;
  double preparation_ms = 0;
};

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
