// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <concepts>
#include <limits>

#include "dynslam/concepts/image.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/image/image.hpp"

namespace dynslam {

/// Smallest and largest depth in the 3x3 neighbourhood of each pixel [m]; NaN where fewer than
/// `min_valid` of the nine are valid.
///
/// With the two bounds a comparison tolerates an error of one pixel in pose and time stamp without
/// looking at nine pixels each time: a point is a violation only when it lies in front of all of
/// them, and consistent when it lies between them.
template <std::floating_point S>
struct DepthBounds {
  Image<S> nearest, farthest;

  /// Recomputes the bounds of `depth` (metres, invalid = NaN or <= 0); memory is reused.
  template <DepthImage D>
  void compute(const D& depth, int min_valid = 5) {
    const int w = depth.width(), h = depth.height();
    nearest.resize(w, h);
    farthest.resize(w, h);
    for (int v = 0; v < h; ++v) {
      for (int u = 0; u < w; ++u) {
        S lo = std::numeric_limits<S>::max(), hi = S(0);
        int valid = 0;
        for (int dv = std::max(0, v - 1); dv <= std::min(h - 1, v + 1); ++dv) {
          for (int du = std::max(0, u - 1); du <= std::min(w - 1, u + 1); ++du) {
            const S z = static_cast<S>(depth(du, dv));
            if (!is_valid_depth(z)) continue;
            lo = std::min(lo, z);
            hi = std::max(hi, z);
            ++valid;
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
