// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <cstdlib>
#include <limits>
#include <vector>

#include "dynslam/concepts/image.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/image/image_row.hpp"

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
      find_columns(depth, v, radius);
      find_row(nearest.row(v), farthest.row(v), w, radius, static_cast<S>(min_valid));
    }
  }

 private:
  static constexpr S kNone = std::numeric_limits<S>::max();

  /// Empty columns on either side of what is known of the columns, so that no loop asks where the image ends.
  static int padding(int radius) { return std::max(1, radius); }

  /// Bounds of each column over the rows about v, and how many of the nearest three are valid.
  template <DepthImage D>
  void find_columns(const D& depth, int v, int radius) {
    const int w = depth.width();
    const int pad = padding(radius);
    const auto padded = static_cast<std::size_t>(w + 2 * pad);
    low_.assign(padded, kNone);
    high_.assign(padded, S(0));
    valid_.assign(padded, S(0));
    S *lo = low_.data() + pad, *hi = high_.data() + pad, *n = valid_.data() + pad;
    for (int y = std::max(0, v - radius); y <= std::min(depth.height() - 1, v + radius); ++y) {
      const auto row = image_row(depth, y);
      const S counts = std::abs(y - v) <= 1 ? S(1) : S(0);
      for (int u = 0; u < w; ++u) {
        const S z = static_cast<S>(row[u]);
        const bool ok = is_valid_depth(z);
        const S near = ok ? z : kNone, far = ok ? z : S(0), one = ok ? counts : S(0);
        lo[u] = near < lo[u] ? near : lo[u];
        hi[u] = far > hi[u] ? far : hi[u];
        n[u] += one;
      }
    }
  }

  void find_row(S* nearest_row, S* farthest_row, int w, int radius, S min_valid) const {
    constexpr S kUnknown = std::numeric_limits<S>::quiet_NaN();
    const int pad = padding(radius);
    const S *lo = low_.data() + pad, *hi = high_.data() + pad, *n = valid_.data() + pad;
    for (int u = 0; u < w; ++u) {
      nearest_row[u] = lo[u];
      farthest_row[u] = hi[u];
    }
    for (int k = -radius; k <= radius; ++k) {
      for (int u = 0; u < w; ++u) {
        nearest_row[u] = std::min(nearest_row[u], lo[u + k]);
        farthest_row[u] = std::max(farthest_row[u], hi[u + k]);
      }
    }
    const S beside = radius > 0 ? S(1) : S(0);
    for (int u = 0; u < w; ++u) {
      const S valid = n[u] + beside * (n[u - 1] + n[u + 1]);
      const S unknown = valid >= min_valid ? S(0) : kUnknown;  // what it is added to is, too
      nearest_row[u] += unknown;
      farthest_row[u] += unknown;
    }
  }

  std::vector<S> low_, high_, valid_;  // of columns
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
