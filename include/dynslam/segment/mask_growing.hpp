// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "dynslam/concepts/image.hpp"
#include "dynslam/config.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/segment/connectivity.hpp"
#include "dynslam/segment/detail/growing_field.hpp"
#include "dynslam/segment/mask.hpp"
#include "dynslam/segment/region_growing.hpp"

namespace dynslam {

/// Counts are in pixels of the image that is grown on; the defaults are for one of about 160 x 120.
struct MaskGrowingOptions {
  int min_seeds = 12;         ///< smaller groups of seeds are noise
  int min_region = 30;        ///< smaller regions are dropped
  int max_hole = 600;         ///< larger holes in a mask stay open
  double max_fraction = 0.9;  ///< share of the valid depth beyond which a region has leaked
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

}  // namespace detail

/// Grows regions from seeds over the depth image (paper, Sec. 3.3).
/// @param depth    [m], invalid = NaN or <= 0
/// @param seed     in: nonzero where motion was seen; out: small groups cleared
/// @param barrier  nonzero where growing must not enter
/// @param mask     out: 255 in regions, holes filled, else 0
/// Images are of any type, of the depth's size; those that are written are given as references or views.
template <DepthImage D, OutputLabelImage Seed, LabelImage Barrier, OutputLabelImage Mask>
MaskGrowingResult grow_mask(const D& depth, Seed&& seed, const Barrier& barrier, Mask&& mask,
                            const MaskGrowingOptions& options, MaskGrowingWorkspace& ws) {
  const int w = depth.width(), h = depth.height();
  DYNSLAM_ASSERT(same_size(depth, seed) && same_size(depth, barrier) && same_size(depth, mask),
                 "all images have the size of the depth image");
  MaskGrowingResult result;
  using S = typename D::Pixel;
  const RelativeStep<S> step{static_cast<S>(options.step.base), static_cast<S>(options.step.quad)};
  detail::remove_small_groups(depth, seed, options.min_seeds, step, ws);
  ws.seeds.clear();
  for (int v = 0; v < h; ++v) {
    for (int u = 0; u < w; ++u) {
      if (seed(u, v) != 0) ws.seeds.push_back({u, v});
      mask(u, v) = 0;
    }
  }
  result.seeds = static_cast<int>(ws.seeds.size());
  if (ws.seeds.empty()) return result;
  RegionGrowingOptions growing;
  growing.max_region_fraction = options.max_fraction;
  growing.max_total_fraction = std::max(growing.max_total_fraction, options.max_fraction);
  growing.min_region_pixels = options.min_region;
  const auto grown =
      grow_regions(depth, barrier, std::span<const PixelIndex>(ws.seeds), step, growing, mask, ws.growing);
  result.regions_leaked = grown.regions_leaked + grown.regions_excess;
  // What touches the outside at a corner is not counted as inside: it more often is seen past the object.
  fill_holes(mask, options.max_hole, Connectivity::eight, ws.morphology);
  return result;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
