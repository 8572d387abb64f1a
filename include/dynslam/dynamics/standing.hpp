// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "dynslam/concepts/image.hpp"
#include "dynslam/config.hpp"
#include "dynslam/image/depth.hpp"

namespace dynslam {

/// Marks (255) what is static wherever that is known, whoever it belongs to: a wall that is called a
/// person, what a mask shows that is late or beside what it means, the legs of a person who turns the head.
/// @param moving    nonzero = seen to move, with a margin
/// @param verified  verified(u, v) -> bool: the surface at a pixel was seen in the same place long before
/// @param stride    pixels: `verified` is asked once per stride x stride of them, in their middle
/// @param still     out, of the size of `moving`: 255 where something stands, as it was elsewhere
template <LabelImage Moving, class Verified, OutputLabelImage Still>
void mark_standing(const Moving& moving, Verified&& verified, int stride, Still&& still) {
  DYNSLAM_ASSERT(same_size(still, moving), "both images have the same size");
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

/// Pixels of an object that have depth, and those of them that are static.
struct StandingCount {
  std::int64_t measured = 0, still = 0;
};

/// Marks the rest of objects most of which is static, but for what moves: a class speaks of whole objects,
/// and part of one that stands has just come into view, or was hidden, and could not be verified.
/// @param objects  number of the object at each pixel, 0: none
/// @param depth    [m]
/// @param moving   nonzero = seen to move
/// @param still    in and out: 255 where something stands (mark_standing())
/// @param counts   memory. All images have the same size.
template <LabelImage Objects, DepthImage Depth, LabelImage Moving, OutputLabelImage Still>
void mark_standing_objects(const Objects& objects, const Depth& depth, const Moving& moving, Still&& still,
                           std::vector<StandingCount>& counts) {
  DYNSLAM_ASSERT(same_size(objects, still) && same_size(depth, still) && same_size(moving, still),
                 "all images have the same size");
  counts.clear();
  for (int v = 0; v < objects.height(); ++v) {
    for (int u = 0; u < objects.width(); ++u) {
      const auto object = static_cast<std::size_t>(objects(u, v));
      if (object == 0 || !is_valid_depth(depth(u, v))) continue;
      if (object >= counts.size()) counts.resize(object + 1);
      ++counts[object].measured;
      counts[object].still += still(u, v) != 0 ? 1 : 0;
    }
  }
  for (int v = 0; v < objects.height(); ++v) {
    for (int u = 0; u < objects.width(); ++u) {
      const auto object = static_cast<std::size_t>(objects(u, v));
      if (object == 0 || object >= counts.size() || moving(u, v) != 0) continue;
      if (2 * counts[object].still > counts[object].measured)
        still(u, v) = static_cast<typename std::remove_reference_t<Still>::Pixel>(255);
    }
  }
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
