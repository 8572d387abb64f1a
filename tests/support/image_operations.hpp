// SPDX-License-Identifier: BSD-3-Clause
// One run of every image operation of segment/ and of the conversion of depth, over one kind of image: the
// same pixels must come out of each kind.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "dynslam/image/depth.hpp"
#include "dynslam/segment/mask.hpp"
#include "dynslam/segment/region_growing.hpp"
#include "image_kinds.hpp"
#include "random.hpp"

namespace dynslam::test {

/// Results of all operations, in a row. Depth as bits of millimetres so that NaN compares equal.
template <class Kind>
[[nodiscard]] std::vector<std::vector<int>> run_image_operations() {
  constexpr int w = 31, h = 22;
  Rng rng("image operations");
  Image<std::uint8_t> mask(w, h), barrier(w, h), zero(w, h);
  Image<std::uint16_t> raw(w, h);
  Image<float> depth(w, h), nothing(w, h);
  for (int v = 0; v < h; ++v) {
    for (int u = 0; u < w; ++u) {
      mask(u, v) = rng.chance(0.5) ? 255 : 0;
      barrier(u, v) = rng.chance(0.05) ? 1 : 0;
      raw(u, v) = static_cast<std::uint16_t>(rng.chance(0.1) ? 0 : rng.integer(4000, 30000));
      depth(u, v) = rng.chance(0.1) ? std::numeric_limits<float>::quiet_NaN()
                                    : 2.0F + 0.03F * static_cast<float>(rng.integer(0, 3));
    }
  }
  std::vector<std::vector<int>> results;
  const auto record = [&](const auto& image) {
    results.emplace_back();
    for (const auto p : pixels_of(image))
      results.back().push_back(std::isnan(static_cast<double>(p))
                                   ? -1
                                   : static_cast<int>(std::lround(1000.0 * static_cast<double>(p))));
  };
  MaskWorkspace workspace;
  const auto in = Kind::make(mask);
  {
    auto out = Kind::make(zero);
    dilate(Kind::in(in), Kind::out(out), 2, workspace);
    record(Kind::in(out));
    erode(Kind::in(in), Kind::out(out), 1, workspace);
    record(Kind::in(out));
    dilate(Kind::in(in), Kind::out(out), 1);  // the short forms
    erode(Kind::in(out), Kind::out(out), 2);
    record(Kind::in(out));
  }
  {
    auto out = Kind::make(mask);
    remove_small(Kind::out(out), 5, workspace);
    record(Kind::in(out));
    fill_holes(Kind::out(out), 6, workspace);
    record(Kind::in(out));
  }
  for (const Connectivity connectivity : {Connectivity::four, Connectivity::eight}) {
    auto labels = Kind::make(Image<int>(w, h));
    std::vector<int> counts;
    results.push_back({connected_components(Kind::in(in), connectivity, Kind::out(labels), counts)});
    results.push_back(counts);
    record(Kind::in(labels));
  }
  const std::vector<PixelIndex> seeds{{3, 4}, {20, 11}, {30, 21}, {9, 17}};
  {
    const auto z = Kind::make(depth);
    const auto closed = Kind::make(barrier);
    auto out = Kind::make(zero);
    RegionGrowingWorkspace growing;
    auto r = grow_regions(Kind::in(z), Kind::in(closed), std::span<const PixelIndex>(seeds),
                          RelativeStep<float>{0.02F, 0.004F}, {}, Kind::out(out), growing);
    results.push_back({r.regions, static_cast<int>(r.pixels)});
    record(Kind::in(out));
    const auto labels = Kind::make(mask);
    const auto& seen = Kind::in(labels);
    const SameLabelStep criterion(seen, RelativeStep<float>{0.05F, 0.004F});
    r = grow_regions(Kind::in(z), std::span<const PixelIndex>(seeds), criterion, {}, Kind::out(out));
    results.push_back({r.regions, static_cast<int>(r.pixels)});
    record(Kind::in(out));
  }
  {
    const auto from = Kind::make(raw);
    auto metres = Kind::make(nothing);
    depth_to_metres(Kind::in(from), 5000.0F, Kind::out(metres));
    record(Kind::in(metres));
  }
  return results;
}

}  // namespace dynslam::test
