// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <cstdint>
#include <type_traits>

#include "dynslam/concepts/image.hpp"
#include "dynslam/config.hpp"

namespace dynslam {

/// Marks (255) what is static wherever that is known, whoever it belongs to: a wall that is called a
/// person, what a mask shows that is late or beside what it means, the legs of a person who turns the head.
/// @param moving    nonzero = seen to move, with a margin
/// @param verified  verified(u, v) -> bool: the surface at a pixel was seen in the same place long before
/// @param stride    pixels: `verified` is asked once per stride x stride of them, in their middle
/// @param still     out, of the size of `moving`: 255 where something stands, as it was elsewhere
template <LabelImage Moving, class Verified, OutputLabelImage Still>
void mark_standing(const Moving& moving, Verified&& verified, int stride, Still&& still) {
  DYNSLAM_ASSERT(still.width() == moving.width() && still.height() == moving.height(),
                 "both images have the same size");
  const int w = moving.width(), h = moving.height();
  for (int v0 = 0; v0 < h; v0 += stride) {
    const int v1 = std::min(h, v0 + stride);
    for (int u0 = 0; u0 < w; u0 += stride) {
      const int u1 = std::min(w, u0 + stride);
      if (!verified((u0 + u1) / 2, (v0 + v1) / 2)) continue;
      for (int v = v0; v < v1; ++v) {
        for (int u = u0; u < u1; ++u) {
          if (moving(u, v) == 0)
            still(u, v) = static_cast<typename std::remove_reference_t<Still>::Pixel>(255);
        }
      }
    }
  }
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
