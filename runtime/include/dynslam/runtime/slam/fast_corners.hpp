// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

namespace dynslam::runtime {

/// A pixel that is a corner, and how strong it is.
struct FastCorner {
  int u = 0, v = 0;
  int score = 0;  ///< largest threshold at which it still is one (grey values)
};

/// FAST-9 corners (Rosten and Drummond 2006): of the ring of 16 pixels at a distance of 3 at least nine in a
/// row are all brighter or all darker than the centre by more than a threshold.
///
/// The corners and scores are cv::FAST's with nonmaxSuppression, in a third of its time: the scores of a
/// whole row of pixels are calculated together, where the ring says that there may be a corner among them.
class FastCorners {
 public:
  static constexpr int kRing = 3;       ///< pixels around `part` that the image must have
  static constexpr int kMinWidth = 38;  ///< of the image [px]

  /// The corners of a part of an image whose score is larger than that of their eight neighbours in the part,
  /// row by row.
  /// @param image      CV_8UC1, at least kMinWidth wide
  /// @param part       at least kRing pixels away from the image's border
  /// @param threshold  0 to 255 grey values
  void find(const cv::Mat& image, const cv::Rect& part, int threshold, std::vector<FastCorner>& out);

 private:
  std::vector<std::uint8_t> scores_;  // of three rows
};

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
