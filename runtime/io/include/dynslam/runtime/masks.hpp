// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>

namespace dynslam::runtime {

/// Classes of label images, synthetic sequences and the semantic map.
enum class Label : std::uint8_t { background = 0, person = 1, chair = 2, display = 3 };

/// What a segmenter said of an earlier frame, for the surfaces that later ones show again.
struct EarlierLabels {
  double t = 0;    ///< of that frame [s]
  cv::Mat depth;   ///< CV_32FC1 metres, NaN = invalid
  cv::Mat labels;  ///< CV_8UC1 of Label
};

/// What a segmenter says of one image.
struct Masks {
  cv::Mat dynamic;    ///< CV_8UC1, 255 = dynamic a priori
  cv::Mat labels;     ///< CV_8UC1 of Label; empty where only a mask is known
  cv::Mat instances;  ///< CV_16UC1, 0 = none; empty where unknown
  /// Where the masks were carried here from another frame: its labels. The octree takes what is static
  /// from them, where the frame was tracked.
  std::shared_ptr<const EarlierLabels> earlier{};
};

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
