// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "dynslam/concepts/image.hpp"
#include "dynslam/config.hpp"
#include "dynslam/image/image.hpp"

namespace dynslam {

/// What counts as a corner.
struct CornerOptions {
  int radius = 3;             ///< half side of the window whose gradients are judged [px]
  int border = 11;            ///< pixels at the image's border without corners: room for a patch
  float min_response = 8.0F;  ///< smaller eigenvalue of the mean gradient product [grey^2/px^2]
};

/// Memory of find_corners; keep it between calls to avoid allocation.
struct CornerWorkspace {
  Image<float> xx, xy, yy, sum;
};

namespace detail {
/// Mean over a square window of half side `radius`, along rows and then along columns; pixels nearer to the
/// border than `radius` are left as they are.
inline void box_mean(Image<float>& image, Image<float>& rows, int radius) {
  const int w = image.width(), h = image.height(), side = 2 * radius + 1;
  rows.resize(w, h);
  const float share = 1.0F / static_cast<float>(side * side);
  for (int v = 0; v < h; ++v) {
    const float* in = image.row(v);
    float* out = rows.row(v);
    float sum = 0;
    for (int u = 0; u < w; ++u) {
      sum += in[u];
      if (u >= side) sum -= in[u - side];
      if (u >= side - 1) out[u - radius] = sum;
    }
  }
  for (int v = radius; v < h - radius; ++v) {
    float* out = image.row(v);
    std::fill(out + radius, out + w - radius, 0.0F);
    for (int dv = -radius; dv <= radius; ++dv) {
      const float* in = rows.row(v + dv);
      for (int u = radius; u < w - radius; ++u) out[u] += in[u];
    }
    for (int u = radius; u < w - radius; ++u) out[u] *= share;
  }
}
}  // namespace detail

/// Corners spread over an image: cut into `count` square cells, in each of them the pixel whose surroundings determine a position
/// best, by the smaller eigenvalue of the mean gradient product (Shi and Tomasi 1994).
/// @param count  wanted, > 0
/// @param out  pixels, cell by cell; fewer than `count` where cells are flat
template <RowImage I>
void find_corners(const I& image, int count, const CornerOptions& options, CornerWorkspace& ws,
                  std::vector<Eigen::Vector2i>& out) {
  DYNSLAM_ASSERT(count > 0 && options.radius >= 0, "a number of corners and a window");
  out.clear();
  const int w = image.width(), h = image.height();
  const int border = std::max(options.border, options.radius + 1);
  if (w <= 2 * border || h <= 2 * border) return;
  for (auto* product : {&ws.xx, &ws.xy, &ws.yy}) {
    product->resize(w, h);
    product->fill(0.0F);
  }
  for (int v = 1; v < h - 1; ++v) {
    const auto *above = image.row(v - 1), *row = image.row(v), *below = image.row(v + 1);
    float *xx = ws.xx.row(v), *xy = ws.xy.row(v), *yy = ws.yy.row(v);
    for (int u = 1; u < w - 1; ++u) {
      const float gx = 0.5F * (static_cast<float>(row[u + 1]) - static_cast<float>(row[u - 1]));
      const float gy = 0.5F * (static_cast<float>(below[u]) - static_cast<float>(above[u]));
      xx[u] = gx * gx;
      xy[u] = gx * gy;
      yy[u] = gy * gy;
    }
  }
  for (auto* product : {&ws.xx, &ws.xy, &ws.yy}) detail::box_mean(*product, ws.sum, options.radius);
  const double area = static_cast<double>(w - 2 * border) * (h - 2 * border);
  const int cell = std::max(1, static_cast<int>(std::ceil(std::sqrt(area / count))));
  for (int top = border; top < h - border; top += cell) {
    for (int left = border; left < w - border; left += cell) {
      float best = options.min_response;
      Eigen::Vector2i corner(-1, -1);
      for (int v = top; v < std::min(top + cell, h - border); ++v) {
        for (int u = left; u < std::min(left + cell, w - border); ++u) {
          const float a = ws.xx(u, v), b = ws.xy(u, v), c = ws.yy(u, v), gap = a - c;
          const float response = 0.5F * (a + c - std::sqrt(gap * gap + 4.0F * b * b));
          if (response <= best) continue;
          best = response;
          corner = {u, v};
        }
      }
      if (corner.x() >= 0) out.push_back(corner);
    }
  }
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
