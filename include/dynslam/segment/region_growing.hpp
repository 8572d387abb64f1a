// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "dynslam/config.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/image/image.hpp"

namespace dynslam {

struct PixelIndex {
  int u, v;
};

/// Decides whether growing may step from one pixel to a neighbour, from their depths [m]. It must be
/// symmetric, or the result depends on the order of the seeds.
template <class C, class S>
concept GrowingCriterion = requires(const C& criterion, S from, S to) {
  { criterion(from, to) } -> std::convertible_to<bool>;
};

/// The paper's: a constant depth step [m]. On real depth it floods through the floor; kept for comparison.
template <std::floating_point S>
struct FixedStep {
  S step = S(0.05);
  [[nodiscard]] bool operator()(S from, S to) const { return std::abs(from - to) < step; }
};

/// A step that grows with the sensor's noise: |dz| < base + quad * z^2, z being the smaller depth.
template <std::floating_point S>
struct RelativeStep {
  S base = S(0.02), quad = S(0.005);
  [[nodiscard]] bool operator()(S from, S to) const {
    const S z = std::min(from, to);
    return std::abs(from - to) < base + quad * z * z;
  }
};

struct RegionGrowingOptions {
  double max_region_fraction = 0.6;  ///< of the valid depth; a larger region has leaked and is dropped
  int min_region_pixels = 1;         ///< smaller regions are dropped
  bool eight_connected = false;
};

struct RegionGrowingResult {
  int regions = 0;         ///< kept
  int regions_leaked = 0;  ///< dropped: too large
  int regions_small = 0;   ///< dropped: too small
  std::size_t pixels = 0;  ///< in the kept regions
};

/// Memory of grow_regions; keep it between calls to avoid allocation.
struct RegionGrowingWorkspace {
  Image<std::uint8_t> visited;
  std::vector<int> queue;  // pixel indices of the present region, also its list
};

/// Grows regions on a depth image from seeds (paper, step 9). A region is everything connected to a
/// seed by steps the criterion allows, through valid depth and outside the barrier; regions that meet
/// are one. A leaked or small region is dropped whole, its seeds included.
///
/// The result does not depend on the order of the seeds. Seeds on invalid depth, on the barrier or
/// outside the image are ignored.
/// @param mask     out: 255 in kept regions, 0 elsewhere; size of `depth`
/// @param barrier  empty, or nonzero where growing must not enter
template <DepthImage D, class Criterion>
  requires GrowingCriterion<Criterion, typename D::Pixel> RegionGrowingResult
  grow_regions(const D& depth, std::span<const PixelIndex> seeds, const Criterion& criterion,
               const RegionGrowingOptions& options, ImageView<std::uint8_t> mask, RegionGrowingWorkspace& ws,
               ImageView<const std::uint8_t> barrier = {}) {
    const int w = depth.width(), h = depth.height();
    DYNSLAM_ASSERT(mask.width() == w && mask.height() == h, "the mask needs the size of the depth image");
    const bool fenced = barrier.data() != nullptr;
    DYNSLAM_ASSERT(!fenced || (barrier.width() == w && barrier.height() == h),
                   "the barrier needs the size of the depth image");
    std::size_t valid = 0;
    ws.visited.resize(w, h);
    for (int v = 0; v < h; ++v) {
      for (int u = 0; u < w; ++u) {
        const bool ok = is_valid_depth(depth(u, v));
        valid += ok ? 1 : 0;
        ws.visited(u, v) = ok && !(fenced && barrier(u, v) != 0) ? 0 : 1;  // closed pixels count as visited
        mask(u, v) = 0;
      }
    }
    const auto limit = static_cast<std::size_t>(options.max_region_fraction * static_cast<double>(valid));
    constexpr int kDu[8] = {-1, 1, 0, 0, -1, 1, -1, 1};
    constexpr int kDv[8] = {0, 0, -1, 1, -1, -1, 1, 1};
    const int directions = options.eight_connected ? 8 : 4;

    RegionGrowingResult result;
    for (const PixelIndex& seed : seeds) {
      if (seed.u < 0 || seed.v < 0 || seed.u >= w || seed.v >= h || ws.visited(seed.u, seed.v) != 0) continue;
      ws.queue.clear();
      ws.queue.push_back(seed.v * w + seed.u);
      ws.visited(seed.u, seed.v) = 1;
      for (std::size_t head = 0; head < ws.queue.size(); ++head) {
        const int u = ws.queue[head] % w, v = ws.queue[head] / w;
        const auto z = depth(u, v);
        for (int k = 0; k < directions; ++k) {
          const int nu = u + kDu[k], nv = v + kDv[k];
          if (nu < 0 || nv < 0 || nu >= w || nv >= h || ws.visited(nu, nv) != 0) continue;
          if (!criterion(z, depth(nu, nv))) continue;
          ws.visited(nu, nv) = 1;
          ws.queue.push_back(nv * w + nu);
        }
      }
      if (ws.queue.size() > limit) {
        ++result.regions_leaked;
      } else if (ws.queue.size() < static_cast<std::size_t>(std::max(0, options.min_region_pixels))) {
        ++result.regions_small;
      } else {
        ++result.regions;
        result.pixels += ws.queue.size();
        for (const int i : ws.queue) mask(i % w, i / w) = 255;
      }
    }
    return result;
  }

}  // namespace dynslam
