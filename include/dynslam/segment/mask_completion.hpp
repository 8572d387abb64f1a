// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <type_traits>
#include <vector>

#include "dynslam/concepts/image.hpp"
#include "dynslam/config.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/image/image_row.hpp"
#include "dynslam/segment/region_growing.hpp"

namespace dynslam {

/// How far a mask reaches into pixels without depth.
struct UnmeasuredOptions {
  double reach = 1 / 20.0;  ///< how far a mask may enter what has no depth, as a share of the image's width
  double contrast = 20;     ///< grey levels on the way that cost as much as the whole reach
};

/// Memory of that; keep it between calls to avoid allocation.
struct UnmeasuredWorkspace {
  Image<std::uint16_t> to_mask, to_rest;  ///< cost from there, of pixels without depth
  std::vector<PixelIndex> touched;
  std::vector<std::vector<PixelIndex>> buckets;  ///< by cost
};

namespace detail {
inline constexpr std::uint16_t kUnreached = 0xffff;

/// Costs of ways over pixels without depth: per pixel, and per grey level between two.
struct WayCosts {
  static constexpr int kPixel = 4;
  int level, limit;
};

/// Spreads what stands in the buckets over the pixels that may be entered, nearest first (Dial's algorithm).
template <class G, class MayEnter, class Reached>
void spread(const G& gray, const WayCosts& costs, Image<std::uint16_t>& cost,
            std::vector<std::vector<PixelIndex>>& buckets, const MayEnter& may_enter,
            const Reached& reached) {
  const int w = gray.width(), h = gray.height();
  for (int c = 0; c <= costs.limit; ++c) {
    auto& bucket = buckets[static_cast<std::size_t>(c)];
    for (std::size_t k = 0; k < bucket.size();
         ++k) {  // none is added to it meanwhile: a step costs something
      const PixelIndex p = bucket[k];
      if (cost(p.u, p.v) != c) continue;  // reached cheaper since
      const auto here = static_cast<double>(gray(p.u, p.v));
      for (const auto& [du, dv] : {std::array{-1, 0}, {1, 0}, {0, -1}, {0, 1}}) {
        const int u = p.u + du, v = p.v + dv;
        if (u < 0 || v < 0 || u >= w || v >= h || !may_enter(u, v)) continue;
        const double levels = std::abs(static_cast<double>(gray(u, v)) - here);
        const int sum = c + WayCosts::kPixel + static_cast<int>(std::min(255.0, levels)) * costs.level;
        if (sum > costs.limit || sum >= cost(u, v)) continue;
        if (cost(u, v) == kUnreached) reached(PixelIndex{u, v});
        cost(u, v) = static_cast<std::uint16_t>(sum);
        buckets[static_cast<std::size_t>(sum)].push_back({u, v});
      }
    }
    bucket.clear();
  }
}
}  // namespace detail

/// Decides for pixels without depth whether they belong to the mask: hair, dark cloth and the outline of near
/// objects have none. Each goes to where the way is cheaper, over pixels without depth and the fewest edges
/// of the grey image, to a measured pixel on the mask or beside it. What neither reaches stays as it is.
/// @param gray   of the size of `depth`, 0 to 255
/// @param depth  [m], invalid = NaN or <= 0
/// @param mask   in and out: nonzero in the mask; what is added is 255
template <ImageLike G, DepthImage D, OutputLabelImage Mask>
void complete_unmeasured(const G& gray, const D& depth, Mask&& mask, const UnmeasuredOptions& options,
                         UnmeasuredWorkspace& ws) {
  using Pixel = typename std::remove_reference_t<Mask>::Pixel;
  DYNSLAM_ASSERT(same_size(depth, mask) && same_size(depth, gray), "all images have one size");
  const int w = depth.width(), h = depth.height();
  const double reach = std::min(options.reach * w, 4000.0);  // so that costs fit 16 bits
  if (!(reach >= 1) || !(options.contrast > 0)) return;
  const detail::WayCosts costs{
      std::max(1, static_cast<int>(std::lround(detail::WayCosts::kPixel * reach / options.contrast))),
      static_cast<int>(detail::WayCosts::kPixel * reach)};
  ws.buckets.resize(std::max(ws.buckets.size(), static_cast<std::size_t>(costs.limit) + 1));
  for (auto* image : {&ws.to_mask, &ws.to_rest}) {
    if (image->width() == w && image->height() == h) continue;
    image->resize(w, h);
    image->fill(detail::kUnreached);
  }
  const auto measured = [&](int u, int v) { return is_valid_depth(depth(u, v)); };
  const auto any_beside = [&](int u, int v, const auto& is) {
    return (u > 0 && is(u - 1, v)) || (u + 1 < w && is(u + 1, v)) || (v > 0 && is(u, v - 1)) ||
           (v + 1 < h && is(u, v + 1));
  };
  // Ways from the mask: over the pixels without depth near it.
  ws.touched.clear();
  const auto open = [&](int u, int v) { return !measured(u, v); };
  for (int v = 0; v < h; ++v) {
    const auto on = image_row(mask, v);
    for (int u = 0; u < w; ++u) {
      if (on[u] == 0) continue;
      if (!measured(u, v)) {  // masked without having been seen there: to be decided, too
        ws.touched.push_back({u, v});
      } else if (any_beside(u, v, open)) {
        ws.to_mask(u, v) = 0;
        ws.touched.push_back({u, v});
        ws.buckets[0].push_back({u, v});
      }
    }
  }
  detail::spread(gray, costs, ws.to_mask, ws.buckets, open, [&](PixelIndex p) { ws.touched.push_back(p); });
  // And from what is measured beside the mask, over the same pixels.
  const std::size_t candidates = ws.touched.size();
  const auto candidate = [&](int u, int v) {
    return !measured(u, v) && (mask(u, v) != 0 || ws.to_mask(u, v) != detail::kUnreached);
  };
  for (std::size_t k = 0; k < candidates; ++k) {
    const PixelIndex p = ws.touched[k];
    if (!candidate(p.u, p.v)) continue;
    for (const auto& [du, dv] : {std::array{-1, 0}, {1, 0}, {0, -1}, {0, 1}}) {
      const int u = p.u + du, v = p.v + dv;
      if (u < 0 || v < 0 || u >= w || v >= h || !measured(u, v) || mask(u, v) != 0) continue;
      if (ws.to_rest(u, v) == 0) continue;
      ws.to_rest(u, v) = 0;
      ws.touched.push_back({u, v});
      ws.buckets[0].push_back({u, v});
    }
  }
  detail::spread(gray, costs, ws.to_rest, ws.buckets, candidate, [](PixelIndex) {});
  for (const PixelIndex& p : ws.touched) {
    std::uint16_t& to_mask = ws.to_mask(p.u, p.v);
    std::uint16_t& to_rest = ws.to_rest(p.u, p.v);
    if (!measured(p.u, p.v) && to_mask != to_rest)
      mask(p.u, p.v) = static_cast<Pixel>(to_mask < to_rest ? 255 : 0);
    to_mask = to_rest = detail::kUnreached;
  }
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
