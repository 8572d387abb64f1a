// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "dynslam/concepts/image.hpp"
#include "dynslam/config.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/image/image_row.hpp"
#include "dynslam/segment/connected_components.hpp"
#include "dynslam/segment/connectivity.hpp"
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
  std::vector<std::uint8_t> region_age;
};

/// Completes objects around what was seen to move (paper, step 9): seeds -> regions -> surfaces completed ->
/// holes filled -> ages.
///
/// Growing must not wander through parts of the scene of which nothing is known yet, so it stays within
/// `reach` of fresh evidence (a seed of age 0). A hole in a mover is the mover: its inside overlaps where it
/// was before and looks at rest.
/// @param depth    [m], invalid = NaN or <= 0
/// @param seed     in: nonzero where motion was seen; out: small groups cleared
/// @param barrier  in: nonzero where growing must not enter; out: with what is out of reach
/// Images are of any type, of the depth's size; those that are written are given as references or views.
/// @param age      in: frames since direct evidence; out: pixels that only the growing reached are as old as
///                 the newest evidence of their region, without which a mask would feed on itself
/// @param mask     out: 255 in regions, else 0
template <DepthImage D, OutputLabelImage Seed, OutputLabelImage Barrier, OutputLabelImage Age,
          OutputLabelImage Mask>
MaskGrowingResult grow_mask(const D& depth, Seed&& seed, Barrier&& barrier, Age&& age, Mask&& mask,
                            const MaskGrowingOptions& options, MaskGrowingWorkspace& ws) {
  const int w = depth.width(), h = depth.height();
  DYNSLAM_ASSERT(
      same_size(depth, seed) && same_size(depth, barrier) && same_size(depth, age) && same_size(depth, mask),
      "all images have the size of the depth image");
  MaskGrowingResult result;
  remove_small(seed, options.min_seeds, ws.morphology);
  ws.seeds.clear();
  ws.zone.resize(w, h);
  for (int v = 0; v < h; ++v) {
    for (int u = 0; u < w; ++u) {
      if (seed(u, v) != 0) ws.seeds.push_back({u, v});
      ws.zone(u, v) = seed(u, v) != 0 && age(u, v) == 0 ? 1 : 0;
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
  using S = typename D::Pixel;
  const RelativeStep<S> step{static_cast<S>(options.step.base), static_cast<S>(options.step.quad)};
  RegionGrowingOptions growing;
  growing.max_region_fraction = options.max_fraction;
  growing.max_total_fraction = std::max(growing.max_total_fraction, options.max_fraction);
  growing.min_region_pixels = options.min_region;
  const auto grown =
      grow_regions(depth, barrier, std::span<const PixelIndex>(ws.seeds), step, growing, mask, ws.growing);
  result.regions_leaked = grown.regions_leaked + grown.regions_excess;
  complete_surfaces(depth, mask, step, options.whole, options.max_fraction, ws.growing);
  // What touches the outside at a corner is not counted as inside: it more often is what is seen past a
  // mover.
  fill_holes(mask, options.max_hole, Connectivity::eight, ws.morphology);

  constexpr std::uint8_t kNever = 255;
  const int n = connected_components(mask, ws.morphology.labels, ws.morphology.counts, ws.morphology);
  ws.region_age.assign(static_cast<std::size_t>(n) + 1, kNever);
  const auto label = [&](int u, int v) { return static_cast<std::size_t>(ws.morphology.labels(u, v)); };
  for (int v = 0; v < h; ++v) {
    for (int u = 0; u < w; ++u) {
      if (label(u, v) == 0 || seed(u, v) == 0) continue;
      std::uint8_t& youngest = ws.region_age[label(u, v)];
      youngest = std::min(youngest, static_cast<std::uint8_t>(age(u, v)));
    }
  }
  for (int v = 0; v < h; ++v) {
    for (int u = 0; u < w; ++u) {
      if (label(u, v) != 0 && seed(u, v) == 0) age(u, v) = ws.region_age[label(u, v)];
    }
  }
  return result;
}

}  // namespace dynslam
