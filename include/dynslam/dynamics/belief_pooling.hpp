// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <vector>

#include "dynslam/config.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/segment/growing_criteria.hpp"

namespace dynslam {

/// How beliefs are pooled within a surface.
struct PoolingOptions {
  float coupling =
      1.0F;  ///< weight of a neighbour on the same surface, beside 1 of what was seen of the cell itself
  RelativeStep<float> step{0.03F, 0.010F};  ///< of depth within a surface
  int sweeps = 3;                           ///< over rows and columns
};

/// Memory of pool_beliefs; keep it between calls to avoid allocation.
struct PoolingWorkspace {
  Image<float> right, down;  ///< coupling of a cell with its neighbour
  Image<float> own;          ///< beliefs before pooling
  std::vector<float> upper, value;
};

namespace detail {
/// Coupling between neighbouring cells of depth `z` and `to` [m]; 0 where one is NaN.
[[nodiscard]] inline float coupling(float z, float to, const PoolingOptions& o) {
  return o.step(z, to) ? o.coupling : 0.0F;
}

/// One line of the grid: solves for its n cells, those of other lines being fixed (Thomas' algorithm).
/// @param system  system(k, before, after, diagonal, right): the k-th row of the tridiagonal system
/// @param write   write(k, x)
template <class System, class Write>
void solve_line(int n, PoolingWorkspace& ws, const System& system, const Write& write) {
  ws.upper.resize(static_cast<std::size_t>(n));
  ws.value.resize(static_cast<std::size_t>(n));
  float upper = 0, value = 0;
  for (int k = 0; k < n; ++k) {
    float before, after, diagonal, right;
    system(k, before, after, diagonal, right);
    const float pivot = 1.0F / (diagonal - before * upper);
    value = (right + before * value) * pivot;
    upper = after * pivot;
    ws.upper[static_cast<std::size_t>(k)] = upper;
    ws.value[static_cast<std::size_t>(k)] = value;
  }
  float x = 0;
  for (int k = n; k-- > 0;) {
    x = ws.value[static_cast<std::size_t>(k)] + ws.upper[static_cast<std::size_t>(k)] * x;
    write(k, x);
  }
}
}  // namespace detail

/// Pools log-odds within connected surfaces: minimises, by line relaxation,
///     sum_c confidence_c (x_c - belief_c)^2 + sum_(c,d) coupling_cd (x_c - x_d)^2,
/// where neighbours are coupled as far as their depth is continuous. A cell that was seen itself keeps about
/// its own belief, so a floor that was seen at rest stays static under the feet that stand on it; a cell of
/// which nothing is known takes the belief of its surface.
/// @param depth       of the cells [m], invalid = NaN
/// @param confidence  of each cell's own belief, > 0
/// @param belief      in and out: log-odds
inline void pool_beliefs(const Image<float>& depth, const Image<float>& confidence, Image<float>& belief,
                         const PoolingOptions& options, PoolingWorkspace& ws) {
  const int w = depth.width(), h = depth.height();
  DYNSLAM_ASSERT(
      confidence.width() == w && confidence.height() == h && belief.width() == w && belief.height() == h,
      "all images have one size");
  ws.right.resize(w, h);
  ws.down.resize(w, h);
  for (int v = 0; v < h; ++v) {
    for (int u = 0; u < w; ++u) {
      const float z = depth(u, v);
      ws.right(u, v) = u + 1 < w ? detail::coupling(z, depth(u + 1, v), options) : 0.0F;
      ws.down(u, v) = v + 1 < h ? detail::coupling(z, depth(u, v + 1), options) : 0.0F;
    }
  }
  ws.own = belief;
  const Image<float>&right = ws.right, &down = ws.down;
  const auto row = [&](int u, int v, float& before, float& after, float& diagonal, float& side) {
    before = u > 0 ? right(u - 1, v) : 0.0F;
    after = right(u, v);
    const float up = v > 0 ? down(u, v - 1) : 0.0F, k = confidence(u, v);
    diagonal = k + before + after + up + down(u, v);
    side = k * ws.own(u, v) + (v > 0 ? up * belief(u, v - 1) : 0.0F) +
           (v + 1 < h ? down(u, v) * belief(u, v + 1) : 0.0F);
  };
  const auto column = [&](int u, int v, float& before, float& after, float& diagonal, float& side) {
    before = v > 0 ? down(u, v - 1) : 0.0F;
    after = down(u, v);
    const float left = u > 0 ? right(u - 1, v) : 0.0F, k = confidence(u, v);
    diagonal = k + before + after + left + right(u, v);
    side = k * ws.own(u, v) + (u > 0 ? left * belief(u - 1, v) : 0.0F) +
           (u + 1 < w ? right(u, v) * belief(u + 1, v) : 0.0F);
  };
  for (int sweep = 0; sweep < options.sweeps; ++sweep) {
    for (int v = 0; v < h; ++v) {
      detail::solve_line(
          w, ws, [&](int u, float& a, float& b, float& d, float& r) { row(u, v, a, b, d, r); },
          [&](int u, float x) { belief(u, v) = x; });
    }
    for (int u = 0; u < w; ++u) {
      detail::solve_line(
          h, ws, [&](int v, float& a, float& b, float& d, float& r) { column(u, v, a, b, d, r); },
          [&](int v, float x) { belief(u, v) = x; });
    }
  }
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
