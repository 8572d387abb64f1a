// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>
#include <vector>

#include "dynslam/concepts/image.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/image/image_row.hpp"
#include "dynslam/segment/connectivity.hpp"
#include "dynslam/segment/detail/growing_field.hpp"
#include "dynslam/segment/growing_criteria.hpp"
#include "dynslam/segment/pixel_runs.hpp"

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
    std::size_t begin, runs;  ///< in `runs`
    std::size_t size;         ///< pixels
    std::int64_t first;       ///< its first pixel, row by row; computed where it decides
  };
  detail::GrowingWords words;
  std::vector<PixelRun> runs;  ///< of the regions, one after the other
  std::vector<Region> regions;
  std::vector<std::uint8_t> written;  ///< by row of the mask
};

namespace detail {
/// Drops the largest regions until the rest is at most this share of the valid depth. Of equal ones that with
/// the first pixel row by row goes first, so the order of the seeds does not matter.
template <class Field>
void drop_excess(Field& field, double share, int width, RegionGrowingWorkspace& workspace,
                 RegionGrowingResult& result) {
  if (!field.more_than_share(result.pixels, share)) return;
  auto& regions = workspace.regions;
  for (auto& region : regions) {
    const auto place = [&](const PixelRun& r) { return std::int64_t(r.v) * width + r.begin; };
    region.first = place(workspace.runs[region.begin]);
    for (std::size_t i = 1; i < region.runs; ++i)
      region.first = std::min(region.first, place(workspace.runs[region.begin + i]));
  }
  std::sort(regions.begin(), regions.end(), [](const auto& a, const auto& b) {
    return a.size != b.size ? a.size > b.size : a.first < b.first;
  });
  std::size_t dropped = 0;
  while (dropped < regions.size() && field.more_than_share(result.pixels, share))
    result.pixels -= regions[dropped++].size;
  regions.erase(regions.begin(), regions.begin() + static_cast<std::ptrdiff_t>(dropped));
  result.regions_excess = static_cast<int>(dropped);
  result.regions = static_cast<int>(regions.size());
}

/// Writes 255 in the regions and 0 elsewhere: a row's first run together with the rest of the row, so that
/// what has one run, which most rows have, is written once.
template <class Mask>
void write_regions(RegionGrowingWorkspace& workspace, Mask& mask) {
  using Pixel = typename Mask::Pixel;
  const int w = mask.width(), h = mask.height();
  auto& written = workspace.written;
  written.assign(static_cast<std::size_t>(h), 0);
  for (const auto& region : workspace.regions) {
    for (std::size_t i = region.begin; i < region.begin + region.runs; ++i) {
      const PixelRun run = workspace.runs[i];
      auto row = image_row(mask, run.v);
      auto& done = written[static_cast<std::size_t>(run.v)];
      if (done == 0) {
        fill_row(row, 0, run.begin, Pixel(0));
        fill_row(row, run.end, w, Pixel(0));
        done = 1;
      }
      fill_row(row, run.begin, run.end, static_cast<Pixel>(255));
    }
  }
  for (int v = 0; v < h; ++v) {
    if (written[static_cast<std::size_t>(v)] == 0) fill_run(mask, {v, 0, w}, Pixel(0));
  }
}

template <class D, class Barrier, class Criterion, class Mask>
RegionGrowingResult grow_regions(const D& depth, const Barrier& barrier, std::span<const PixelIndex> seeds,
                                 const Criterion& criterion, const RegionGrowingOptions& options, Mask& mask,
                                 RegionGrowingWorkspace& workspace) {
  const int w = depth.width(), h = depth.height();
  GrowingField field(depth, barrier, criterion, workspace.words);
  const auto smallest = static_cast<std::size_t>(std::max(0, options.min_region_pixels));
  workspace.runs.clear();
  workspace.regions.clear();
  RegionGrowingResult result;
  for (const PixelIndex& seed : seeds) {
    if (seed.u < 0 || seed.v < 0 || seed.u >= w || seed.v >= h || !field.open(seed.u, seed.v)) continue;
    const std::size_t begin = workspace.runs.size();
    const std::size_t size =
        options.connectivity == Connectivity::eight
            ? field.template take_region<Connectivity::eight>(seed.u, seed.v, workspace.runs)
            : field.template take_region<Connectivity::four>(seed.u, seed.v, workspace.runs);
    const bool leaked = field.more_than_share(size, options.max_region_fraction);
    if (!leaked && size >= smallest) {
      ++result.regions;
      result.pixels += size;
      workspace.regions.push_back({begin, workspace.runs.size() - begin, size, 0});
    } else {
      ++(leaked ? result.regions_leaked : result.regions_small);
      workspace.runs.resize(begin);
    }
  }
  drop_excess(field, options.max_total_fraction, w, workspace, result);
  write_regions(workspace, mask);
  return result;
}
}  // namespace detail

/// Grows regions on a depth image from seeds (paper, Sec. 3.3). A region is everything connected to a
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

#include "dynslam/pop_macros.hpp"
