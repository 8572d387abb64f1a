// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <type_traits>
#include <vector>

#include "dynslam/concepts/image.hpp"
#include "dynslam/config.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/segment/connectivity.hpp"
#include "dynslam/segment/growing_field.hpp"
#include "dynslam/segment/mask.hpp"
#include "dynslam/segment/mask_completion.hpp"
#include "dynslam/segment/region_growing.hpp"

namespace dynslam {

/// Counts are in pixels of the image that is grown on; the defaults are for one of about 160 x 120.
struct MaskGrowingOptions {
  int min_seeds = 12;         ///< smaller groups of seeds are noise
  int min_region = 30;        ///< smaller regions are dropped
  int reach = 8;              ///< pixels around fresh evidence that a region may fill; < 0: any number
  int max_hole = 600;         ///< larger holes in a mask stay open
  double max_fraction = 0.9;  ///< share of the valid depth beyond which a region has leaked
  double whole = 0.6;         ///< share of a connected surface from which on all of it moves; above 1: never
  double was = 0.8;           ///< share of a surface on the last mask from which on it was a mover
  double still = 0.3;         ///< and from which on, as `whole`, it is one still
  RelativeStep<float> step{0.03F, 0.010F};  ///< between neighbouring pixels [m, 1/m]: the sensor's noise
};

/// What the growing of a motion mask did.
struct MaskGrowingResult {
  int seeds = 0;           ///< pixels that started the growing
  int regions_leaked = 0;  ///< dropped by the guard
};

/// Memory of the growing; keep it between calls to avoid allocation.
struct MaskGrowingWorkspace {
  RegionGrowingWorkspace growing;
  MaskWorkspace morphology;
  Image<std::uint8_t> zone;
  std::vector<PixelIndex> seeds;
  std::vector<float> ages;  ///< of one surface's seeds
};

namespace detail {
/// Clears seeds of which fewer than `least` lie beside each other on one surface: one that a mover's rim left
/// on the wall behind it is no evidence that the wall moves, however many the mover has.
template <class D, class Seed, class Step>
void remove_small_groups(const D& depth, Seed&& seed, int least, const Step& step, MaskGrowingWorkspace& ws) {
  const int w = depth.width(), h = depth.height();
  ws.zone.resize(w, h);
  for (int v = 0; v < h; ++v) {
    for (int u = 0; u < w; ++u) ws.zone(u, v) = seed(u, v) == 0 ? 1 : 0;
  }
  const auto outside = ws.zone.view();
  GrowingField field(depth, outside, step, ws.growing.words);
  std::vector<PixelRun>& runs = ws.growing.runs;
  for (int v = 0; v < h; ++v) {
    for (int u = 0; u < w; ++u) {
      if (!field.open(u, v)) continue;
      runs.clear();
      if (field.template take_region<Connectivity::eight>(u, v, runs) >= static_cast<std::size_t>(least))
        continue;
      for (const PixelRun& run : runs) {
        for (int x = run.begin; x < run.end; ++x) seed(x, run.v) = 0;
      }
    }
  }
}

/// Makes what of the mask is no seed as old as the evidence on its surface: as its newest quarter, since one
/// false seed must not keep a surface young. What is on no seed's surface has no evidence: its age is
/// infinite.
template <class D, class Seed, class Age, class Mask, class Step>
void spread_ages(const D& depth, const Seed& seed, Age&& age, const Mask& mask, const Step& step,
                 MaskGrowingWorkspace& ws) {
  using T = typename std::remove_reference_t<Age>::Pixel;
  for (int v = 0; v < depth.height(); ++v) {
    for (int u = 0; u < depth.width(); ++u) {
      ws.zone(u, v) = mask(u, v) == 0 ? 1 : 0;
      if (mask(u, v) != 0 && seed(u, v) == 0) age(u, v) = std::numeric_limits<T>::infinity();
    }
  }
  const auto outside = ws.zone.view();
  GrowingField field(depth, outside, step, ws.growing.words);
  for (const PixelIndex& s : ws.seeds) {
    if (!field.open(s.u, s.v)) continue;
    std::vector<PixelRun>& runs = ws.growing.runs;
    runs.clear();
    (void)field.template take_region<Connectivity::four>(s.u, s.v, runs);
    ws.ages.clear();
    for (const PixelRun& run : runs) {
      for (int u = run.begin; u < run.end; ++u) {
        if (seed(u, run.v) != 0) ws.ages.push_back(static_cast<float>(age(u, run.v)));
      }
    }
    const auto newest = ws.ages.begin() + static_cast<std::ptrdiff_t>((ws.ages.size() - 1) / 4);
    std::nth_element(ws.ages.begin(), newest, ws.ages.end());
    for (const PixelRun& run : runs) {
      for (int u = run.begin; u < run.end; ++u) {
        if (seed(u, run.v) == 0) age(u, run.v) = static_cast<T>(*newest);
      }
    }
  }
}
}  // namespace detail

/// Completes objects around what was seen to move (paper, step 9): seeds -> regions -> surfaces completed ->
/// holes filled -> ages.
///
/// Growing must not wander through parts of the scene of which nothing is known yet, so it stays within
/// `reach` of fresh evidence (a seed of age 0). A hole in a mover is the mover: its inside overlaps where it
/// was before and looks at rest.
/// @param depth    [m], invalid = NaN or <= 0
/// @param last     nonzero where the image before was masked; 0 x 0: nobody knows
/// @param seed     in: nonzero where motion was seen; out: small groups cleared
/// @param barrier  in: nonzero where growing must not enter; out: with what is out of reach
/// Images are of any type, of the depth's size; those that are written are given as references or views.
/// @param age      in: time since direct evidence [s], 0 where it is of now, infinite without any (where
/// there is
///                 no seed it is not read); out: pixels that only the growing reached are as old as
///                 the newest quarter of the evidence on their surface, without which a mask would feed on
///                 itself: what is seen past a mover, and was taken for it once, must not stay young by its
///                 side
/// @param mask     out: 255 in regions, else 0
template <DepthImage D, LabelImage Last, OutputLabelImage Seed, OutputLabelImage Barrier, OutputImage Age,
          OutputLabelImage Mask>
  requires std::floating_point<typename std::remove_reference_t<Age>::Pixel> MaskGrowingResult
  grow_mask(const D& depth, const Last& last, Seed&& seed, Barrier&& barrier, Age&& age, Mask&& mask,
            const MaskGrowingOptions& options, MaskGrowingWorkspace& ws) {
    const int w = depth.width(), h = depth.height();
    DYNSLAM_ASSERT(same_size(depth, seed) && same_size(depth, barrier) && same_size(depth, age) &&
                       same_size(depth, mask),
                   "all images have the size of the depth image");
    MaskGrowingResult result;
    using S = typename D::Pixel;
    const RelativeStep<S> step{static_cast<S>(options.step.base), static_cast<S>(options.step.quad)};
    detail::remove_small_groups(depth, seed, options.min_seeds, step, ws);
    ws.seeds.clear();
    for (int v = 0; v < h; ++v) {
      for (int u = 0; u < w; ++u) {
        if (seed(u, v) != 0) ws.seeds.push_back({u, v});
        ws.zone(u, v) = seed(u, v) != 0 && !(age(u, v) > 0) ? 1 : 0;
        mask(u, v) = 0;
      }
    }
    result.seeds = static_cast<int>(ws.seeds.size());
    if (ws.seeds.empty()) return result;
    if (options.reach >= 0) {
      dilate(ws.zone.view(), ws.zone.view(), options.reach, ws.morphology);
      for (int v = 0; v < h; ++v) {
        for (int u = 0; u < w; ++u) {
          if (ws.zone(u, v) == 0 && seed(u, v) == 0) barrier(u, v) = 1;
        }
      }
    }
    RegionGrowingOptions growing;
    growing.max_region_fraction = options.max_fraction;
    growing.max_total_fraction = std::max(growing.max_total_fraction, options.max_fraction);
    growing.min_region_pixels = options.min_region;
    const auto grown =
        grow_regions(depth, barrier, std::span<const PixelIndex>(ws.seeds), step, growing, mask, ws.growing);
    result.regions_leaked = grown.regions_leaked + grown.regions_excess;
    const auto share = [&](std::span<const PixelRun> runs) {
      if (!same_size(depth, last)) return options.whole;
      std::size_t size = 0, was = 0;
      for (const PixelRun& run : runs) {
        size += static_cast<std::size_t>(run.end - run.begin);
        for (int u = run.begin; u < run.end; ++u) was += last(u, run.v) != 0 ? 1 : 0;
      }
      return static_cast<double>(was) < options.was * static_cast<double>(size) ? options.whole
                                                                                : options.still;
    };
    if (std::min(options.whole, options.still) <= 1)
      complete_surfaces(depth, mask, step, share, options.max_fraction, ws.growing);
    // What touches the outside at a corner is not counted as inside: it more often is what is seen past a
    // mover.
    fill_holes(mask, options.max_hole, Connectivity::eight, ws.morphology);
    detail::spread_ages(depth, seed, age, mask, step, ws);
    return result;
  }

}  // namespace dynslam
