// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <cstdint>

#include "dynslam/image/image.hpp"

namespace dynslam {

/// What is known of the cells of the present frame: the log-odds that what is seen there moves.
struct MotionEvidence {
  Image<float> belief;         ///< log-odds of motion
  Image<float> confidence;     ///< in `belief`: 1 where the surface was seen before, little where it is new
  Image<std::uint8_t> fresh;   ///< 1: where the space was seen to be free
  Image<std::uint8_t> rested;  ///< 1: in the same place long before
  /// Depth of a surface that was there shortly before and is no more, for one sees past it; 0: none [m].
  Image<float> gone;

  /// Of this size, and nothing known of any cell.
  void clear(int width, int height, float prior, float unseen) {
    for (auto* image : {&belief, &confidence, &gone}) image->resize(width, height);
    for (auto* image : {&fresh, &rested}) image->resize(width, height), image->fill(0);
    belief.fill(prior);
    confidence.fill(unseen);
    gone.fill(0.0F);
  }
  /// Adds independent evidence: a log-likelihood ratio.
  void add(std::size_t cell, float log_ratio) {
    belief.data()[cell] += log_ratio;
    confidence.data()[cell] = 1;
  }
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
