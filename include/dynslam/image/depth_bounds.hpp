// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <concepts>
#include <cstdlib>
#include <limits>

#include "dynslam/concepts/image.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/image/image.hpp"

namespace dynslam {

/// Smallest and largest depth in the neighbourhood of each pixel [m], a square of half side `radius`; NaN
/// where fewer than `min_valid` of the nearest nine are valid.
///
/// With the two bounds a comparison tolerates an error of `radius` pixels in pose and time stamp without
/// looking at all of them each time: a point is a violation only when it lies in front of all of
/// them, and consistent when it lies between them.
template <std::floating_point S>
struct DepthBounds {
  Image<S> nearest, farthest;

  /// Recomputes the bounds of `depth` (metres, invalid = NaN or <= 0); memory is reused.
  template <DepthImage D>
  void compute(const D& depth, int min_valid = 5, int radius = 1) {
    const int w = depth.width(), h = depth.height();
    nearest.resize(w, h);
    farthest.resize(w, h);
    for (int v = 0; v < h; ++v) {
      for (int u = 0; u < w; ++u) {
        S lo = std::numeric_limits<S>::max(), hi = S(0);
        int valid = 0;
        for (int dv = std::max(0, v - radius); dv <= std::min(h - 1, v + radius); ++dv) {
          for (int du = std::max(0, u - radius); du <= std::min(w - 1, u + radius); ++du) {
            const S z = static_cast<S>(depth(du, dv));
            if (!is_valid_depth(z)) continue;
            lo = std::min(lo, z);
            hi = std::max(hi, z);
            valid += std::abs(du - u) <= 1 && std::abs(dv - v) <= 1 ? 1 : 0;
          }
        }
        const bool ok = valid >= min_valid;
        nearest(u, v) = ok ? lo : std::numeric_limits<S>::quiet_NaN();
        farthest(u, v) = ok ? hi : std::numeric_limits<S>::quiet_NaN();
      }
    }
  }
};

}  // namespace dynslam
