// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>
#include <vector>

#include "dynslam/concepts/image.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/image/image_row.hpp"
#include "dynslam/segment/connectivity.hpp"
#include "dynslam/segment/growing_criteria.hpp"

namespace dynslam {

/// A pixel by its column and row.
struct PixelIndex {
  int u, v;
};

/// Options of grow_regions.
struct RegionGrowingOptions {
  /// Share of the valid depth beyond which a region has leaked, and is dropped: no mover fills most of the
  /// view.
  double max_region_fraction = 0.6;
  /// Share of the valid depth beyond which all regions together have leaked: the largest are dropped until
  /// the rest fits. More than one mover may be there, but a pose needs something at rest.
  double max_total_fraction = 0.8;
  int min_region_pixels = 1;  ///< smaller regions are dropped
  Connectivity connectivity = Connectivity::four;
};

/// Whether grow_regions could begin.
enum class RegionGrowingStatus : std::uint8_t {
  success,
  size_mismatch  ///< mask or barrier differ in size from the depth image; nothing was written
};

/// What grow_regions kept and dropped.
struct RegionGrowingResult {
  RegionGrowingStatus status = RegionGrowingStatus::success;
  int regions = 0;         ///< kept
  int regions_leaked = 0;  ///< dropped: too large
  int regions_excess = 0;  ///< dropped: the largest of too much together
  int regions_small = 0;   ///< dropped: too small
  std::size_t pixels = 0;  ///< in the kept regions
  [[nodiscard]] bool ok() const { return status == RegionGrowingStatus::success; }
};

/// Memory of grow_regions; keep it between calls to avoid allocation.
struct RegionGrowingWorkspace {
  struct Region {
    std::size_t begin, size;  ///< in `queue`
    std::int64_t first;       ///< its first pixel, row by row; computed where it decides
  };
  Image<std::uint8_t> visited;    ///< with a rim of one pixel
  std::vector<PixelIndex> queue;  ///< pixels of the regions, one after the other
  std::vector<Region> regions;
};

namespace detail {
/// Stands for a barrier that is not there.
struct NoBarrier {
  using Pixel = std::uint8_t;
  [[nodiscard]] static int width() { return 0; }
  [[nodiscard]] static int height() { return 0; }
  [[nodiscard]] std::uint8_t operator()(int, int) const { return 0; }
};

/// Marks as visited what growing must not enter, in an image with a closed rim of one pixel, so that growing
/// needs no look at the border. @return pixels of valid depth
template <class D, class Barrier>
std::size_t close_pixels(const D& depth, const Barrier& barrier, Image<std::uint8_t>& visited) {
  const int w = depth.width(), h = depth.height();
  std::size_t valid = 0;
  visited.resize(w + 2, h + 2);
  std::fill_n(visited.row(0), w + 2, std::uint8_t{1});
  std::fill_n(visited.row(h + 1), w + 2, std::uint8_t{1});
  for (int v = 0; v < h; ++v) {
    const auto z = image_row(depth, v);
    const auto closed = image_row(barrier, v);
    std::uint8_t* out = visited.row(v + 1);
    out[0] = out[w + 1] = 1;
    for (int u = 0; u < w; ++u) {
      const bool ok = is_valid_depth(z[u]);
      valid += ok ? 1 : 0;
      out[u + 1] = ok && closed[u] == 0 ? 0 : 1;
    }
  }
  return valid;
}

/// Appends to the queue everything that a seed reaches.
template <Connectivity connectivity, class D, class Criterion>
void grow_from(const D& depth, PixelIndex seed, const Criterion& criterion,
               RegionGrowingWorkspace& workspace) {
  using S = typename D::Pixel;
  auto& queue = workspace.queue;
  const int width = workspace.visited.width();
  std::uint8_t* visited = workspace.visited.data() + width + 1;  // of the pixel (0, 0)
  const auto place = [width](int u, int v) { return static_cast<std::ptrdiff_t>(v) * width + u; };
  std::size_t head = queue.size();
  queue.push_back(seed);
  visited[place(seed.u, seed.v)] = 1;
  for (; head < queue.size(); ++head) {
    const PixelIndex p = queue[head];
    const GrowingSite<S> from{p.u, p.v, depth(p.u, p.v)};
    const auto step = [&](int du, int dv) {
      const int u = p.u + du, v = p.v + dv;
      std::uint8_t& seen = visited[place(u, v)];
      if (seen != 0 || !may_step(criterion, from, GrowingSite<S>{u, v, depth(u, v)})) return;
      seen = 1;
      queue.push_back({u, v});
    };
    step(-1, 0);
    step(1, 0);
    step(0, -1);
    step(0, 1);
    if constexpr (connectivity == Connectivity::eight) {
      step(-1, -1);
      step(1, -1);
      step(-1, 1);
      step(1, 1);
    }
  }
}

/// Drops the largest regions until the rest has at most `limit` pixels. Of equal ones that with the first
/// pixel row by row goes first, so the order of the seeds does not matter.
inline void drop_excess(std::size_t limit, int width, RegionGrowingWorkspace& workspace,
                        RegionGrowingResult& result) {
  if (result.pixels <= limit) return;
  auto& regions = workspace.regions;
  for (auto& region : regions) {
    const auto place = [&](const PixelIndex& p) { return std::int64_t(p.v) * width + p.u; };
    region.first = place(workspace.queue[region.begin]);
    for (std::size_t i = 1; i < region.size; ++i)
      region.first = std::min(region.first, place(workspace.queue[region.begin + i]));
  }
  std::sort(regions.begin(), regions.end(), [](const auto& a, const auto& b) {
    return a.size != b.size ? a.size > b.size : a.first < b.first;
  });
  std::size_t dropped = 0;
  while (dropped < regions.size() && result.pixels > limit) result.pixels -= regions[dropped++].size;
  regions.erase(regions.begin(), regions.begin() + static_cast<std::ptrdiff_t>(dropped));
  result.regions_excess = static_cast<int>(dropped);
  result.regions = static_cast<int>(regions.size());
}

template <class D, class Barrier, class Criterion, class Mask>
RegionGrowingResult grow_regions(const D& depth, const Barrier& barrier, std::span<const PixelIndex> seeds,
                                 const Criterion& criterion, const RegionGrowingOptions& options, Mask& mask,
                                 RegionGrowingWorkspace& workspace) {
  const int w = depth.width(), h = depth.height();
  const std::size_t valid = close_pixels(depth, barrier, workspace.visited);
  const auto share = [&](double fraction) {
    return static_cast<std::size_t>(std::max(0.0, fraction) * static_cast<double>(valid));
  };
  const std::size_t limit = share(options.max_region_fraction);
  const auto smallest = static_cast<std::size_t>(std::max(0, options.min_region_pixels));
  workspace.queue.clear();
  workspace.regions.clear();
  RegionGrowingResult result;
  for (const PixelIndex& seed : seeds) {
    if (seed.u < 0 || seed.v < 0 || seed.u >= w || seed.v >= h ||
        workspace.visited(seed.u + 1, seed.v + 1) != 0)
      continue;
    const std::size_t begin = workspace.queue.size();
    if (options.connectivity == Connectivity::eight) {
      grow_from<Connectivity::eight>(depth, seed, criterion, workspace);
    } else {
      grow_from<Connectivity::four>(depth, seed, criterion, workspace);
    }
    const std::size_t size = workspace.queue.size() - begin;
    if (size <= limit && size >= smallest) {
      ++result.regions;
      result.pixels += size;
      workspace.regions.push_back({begin, size, 0});
    } else {
      ++(size > limit ? result.regions_leaked : result.regions_small);
      workspace.queue.resize(begin);
    }
  }
  drop_excess(share(options.max_total_fraction), w, workspace, result);
  for (int v = 0; v < h; ++v) {
    auto row = image_row(mask, v);
    for (int u = 0; u < w; ++u) row[u] = 0;
  }
  for (const auto& region : workspace.regions) {
    for (std::size_t i = region.begin; i < region.begin + region.size; ++i) {
      const PixelIndex p = workspace.queue[i];
      mask(p.u, p.v) = static_cast<typename Mask::Pixel>(255);
    }
  }
  return result;
}
}  // namespace detail

/// Grows regions on a depth image from seeds (paper, step 9). A region is everything connected to a
/// seed by steps the criterion allows, through valid depth and outside the barrier; regions that meet
/// are one. A leaked or small region is dropped whole, its seeds included, and so are the largest ones when
/// all together are too much.
///
/// The result does not depend on the order of the seeds. Seeds on invalid depth, on the barrier or
/// outside the image are ignored.
/// @param barrier    nonzero where growing must not enter; size of `depth`
/// @param criterion  by depths or by pixels, see growing_criteria.hpp
/// @param mask       out: 255 in kept regions, 0 elsewhere; size of `depth`
template <DepthImage D, LabelImage Barrier, class Criterion, OutputLabelImage Mask>
  requires GrowingCriterion<Criterion, typename D::Pixel> RegionGrowingResult grow_regions(
      const D& depth, const Barrier& barrier, std::span<const PixelIndex> seeds, const Criterion& criterion,
      const RegionGrowingOptions& options, Mask&& mask, RegionGrowingWorkspace& workspace) {
    if (!same_size(depth, mask) || !same_size(depth, barrier))
      return {.status = RegionGrowingStatus::size_mismatch};
    return detail::grow_regions(depth, barrier, seeds, criterion, options, mask, workspace);
  }
/// Without a barrier.
template <DepthImage D, class Criterion, OutputLabelImage Mask>
  requires GrowingCriterion<Criterion, typename D::Pixel> RegionGrowingResult
  grow_regions(const D& depth, std::span<const PixelIndex> seeds, const Criterion& criterion,
               const RegionGrowingOptions& options, Mask&& mask, RegionGrowingWorkspace& workspace) {
    if (!same_size(depth, mask)) return {.status = RegionGrowingStatus::size_mismatch};
    return detail::grow_regions(depth, detail::NoBarrier{}, seeds, criterion, options, mask, workspace);
  }
/// Without a barrier and without memory from call to call.
template <DepthImage D, class Criterion, OutputLabelImage Mask>
  requires GrowingCriterion<Criterion, typename D::Pixel> RegionGrowingResult
  grow_regions(const D& depth, std::span<const PixelIndex> seeds, const Criterion& criterion,
               const RegionGrowingOptions& options, Mask&& mask) {
    RegionGrowingWorkspace workspace;
    return grow_regions(depth, seeds, criterion, options, mask, workspace);
  }

}  // namespace dynslam
