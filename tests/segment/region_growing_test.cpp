// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/segment/region_growing.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/image/normals.hpp"
#include "pixels.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

/// A person 1.5 m away who stands on a floor that runs from under the camera to a wall at 4 m.
Image<float> person_on_floor() {
  Image<float> depth(160, 120, 4.0F);
  for (int v = 70; v < 120; ++v) {
    for (int u = 0; u < 160; ++u) depth(u, v) = 4.0F - 2.6F * static_cast<float>(v - 70) / 49.0F;
  }
  for (int v = 20; v < 117; ++v) {
    for (int u = 60; u < 95; ++u) depth(u, v) = 1.5F;
  }
  return depth;
}

}  // namespace

TEST_CASE("a fixed step floods through the floor; the guard drops it, the relative step does not leak") {
  const auto depth = person_on_floor();
  RegionGrowingWorkspace ws;
  Image<std::uint8_t> mask(160, 120);
  const std::vector<PixelIndex> seed{{75, 60}};
  RegionGrowingOptions unguarded;
  unguarded.max_region_fraction = unguarded.max_total_fraction = 1.0;
  auto result = grow_regions(depth, std::span<const PixelIndex>(seed), FixedStep<float>{0.06F}, unguarded,
                             mask.view(), ws);
  CHECK(result.pixels > 6000);  // the person has 3395
  RegionGrowingOptions guarded;
  guarded.max_region_fraction = 0.4;
  result = grow_regions(depth, std::span<const PixelIndex>(seed), FixedStep<float>{0.06F}, guarded,
                        mask.view(), ws);
  CHECK(result.regions_leaked == 1);
  CHECK(result.pixels == 0);
  CHECK(*std::max_element(mask.data(), mask.data() + 160 * 120) == 0);
  result = grow_regions(depth, std::span<const PixelIndex>(seed), RelativeStep<float>{0.01F, 0.004F}, guarded,
                        mask.view(), ws);
  CHECK(result.regions == 1);
  CHECK(result.pixels == 35 * 97 + 160);  // and the one row of the floor that is as far away as the feet
}

TEST_CASE("a barrier stops growing, also around the feet") {
  const auto depth = person_on_floor();
  Image<std::uint8_t> mask(160, 120), barrier(160, 120);
  for (int v = 112; v < 120; ++v) {
    for (int u = 0; u < 160; ++u) barrier(u, v) = 1;
  }
  RegionGrowingWorkspace ws;
  const std::vector<PixelIndex> seeds{{75, 60}, {10, 115}};
  const auto result = grow_regions(depth, barrier, std::span<const PixelIndex>(seeds),
                                   FixedStep<float>{0.06F}, {}, mask.view(), ws);
  CHECK(result.pixels == 35 * 92);
  CHECK(mask(75, 111) == 255);
  CHECK(mask(75, 112) == 0);
  CHECK(mask(10, 115) == 0);  // a seed on the barrier
}

TEST_CASE("the region is valid depth only and does not depend on the order of the seeds") {
  test::Rng rng("seed order");
  Image<float> depth(60, 40);
  for (int v = 0; v < 40; ++v) {
    for (int u = 0; u < 60; ++u) {
      depth(u, v) = rng.chance(0.1) ? std::numeric_limits<float>::quiet_NaN()
                                    : 2.0F + 0.03F * static_cast<float>(rng.integer(0, 4));
    }
  }
  std::vector<PixelIndex> seeds;
  for (int i = 0; i < 30; ++i) seeds.push_back({rng.integer(-2, 61), rng.integer(-2, 41)});
  RegionGrowingOptions options;
  options.max_region_fraction = 0.5;
  options.min_region_pixels = 4;
  RegionGrowingWorkspace ws;
  Image<std::uint8_t> first(60, 40), other(60, 40);
  const RelativeStep<float> criterion{0.02F, 0.004F};
  const auto a =
      grow_regions(depth, std::span<const PixelIndex>(seeds), criterion, options, first.view(), ws);
  for (int trial = 0; trial < 10; ++trial) {
    std::shuffle(seeds.begin(), seeds.end(), rng.engine());
    const auto b =
        grow_regions(depth, std::span<const PixelIndex>(seeds), criterion, options, other.view(), ws);
    CHECK(b.pixels == a.pixels);
    CHECK(b.regions == a.regions);
    CHECK(test::pixels(first) == test::pixels(other));
  }
  for (int v = 0; v < 40; ++v) {
    for (int u = 0; u < 60; ++u) {
      if (first(u, v) != 0) CHECK(is_valid_depth(depth(u, v)));
    }
  }
}

TEST_CASE("two walls that a false seed each floods do not mask everything: all regions have a limit, too") {
  // Each wall is half the image, which no limit of one region forbids.
  Image<float> depth(40, 20, 2.0F);
  for (int v = 0; v < 20; ++v) {
    for (int u = 20; u < 40; ++u) depth(u, v) = 3.0F;
  }
  for (int v = 4; v < 8; ++v) {
    for (int u = 4; u < 8; ++u) depth(u, v) = 1.0F;  // what really moves
  }
  std::vector<PixelIndex> seeds{{1, 1}, {30, 10}, {5, 5}};
  RegionGrowingWorkspace ws;
  Image<std::uint8_t> mask(40, 20);
  const auto grow = [&](double total) {
    RegionGrowingOptions options;
    options.max_total_fraction = total;
    return grow_regions(depth, std::span<const PixelIndex>(seeds), RelativeStep<float>{}, options,
                        mask.view(), ws);
  };
  CHECK(grow(1.0).pixels == 800);  // as it was: everything
  for (int order = 0; order < 6; ++order) {
    std::next_permutation(seeds.begin(), seeds.end(),
                          [](const PixelIndex& a, const PixelIndex& b) { return a.u < b.u; });
    auto result = grow(0.8);
    CHECK(result.ok());
    CHECK(result.regions == 2);
    CHECK(result.regions_excess == 1);
    CHECK(result.pixels == 400);
    CHECK(mask(30, 10) == 0);  // the largest goes
    CHECK(mask(1, 1) == 255);
    result = grow(0.4);
    CHECK(result.regions == 1);
    CHECK(result.regions_excess == 2);
    CHECK(result.pixels == 16);
    CHECK(mask(5, 5) == 255);
  }
  // Of two of one size the upper left one goes, whatever the order of the seeds.
  for (int v = 4; v < 8; ++v) {
    for (int u = 4; u < 8; ++u) depth(u, v) = 2.0F;
  }
  for (const auto& two :
       {std::vector<PixelIndex>{{1, 1}, {30, 10}}, std::vector<PixelIndex>{{30, 10}, {1, 1}}}) {
    seeds = two;
    CHECK(grow(0.8).regions == 1);
    CHECK(mask(1, 1) == 0);
    CHECK(mask(30, 10) == 255);
  }
}

TEST_CASE_TEMPLATE("a region has leaked where it is more than its share of all valid depth, to the pixel", S,
                   float, double) {
  test::Rng rng("share of valid depth");
  RegionGrowingWorkspace ws;
  int kept = 0, leaked = 0;
  for (int trial = 0; trial < 60; ++trial) {
    const int w = rng.integer(1, 300), h = rng.integer(1, 60);
    Image<S> depth(w, h);
    Image<std::uint8_t> mask(w, h), labels(w, h, 1);
    const double holes = rng.uniform(0, 0.5), edges = rng.uniform(0, 0.6);
    std::size_t valid = 0;
    for (int v = 0; v < h; ++v) {
      for (int u = 0; u < w; ++u) {
        depth(u, v) = rng.chance(holes) ? S(0) : rng.chance(edges) ? S(3) : S(2);
        if (rng.chance(0.05)) depth(u, v) = std::numeric_limits<S>::quiet_NaN();
        if (depth(u, v) > S(0)) ++valid;
      }
    }
    const FixedStep<S> fixed{S(0.1)};
    const SameLabelStep same(labels, fixed);
    std::vector<PixelIndex> seeds;
    for (int k = 0; k < 6; ++k) seeds.push_back({rng.integer(0, w - 1), rng.integer(0, h - 1)});
    const auto grow = [&](std::span<const PixelIndex> of, double share) {
      RegionGrowingOptions options;
      options.max_region_fraction = share;
      options.max_total_fraction = 1;
      return trial % 2 == 0 ? grow_regions(depth, of, fixed, options, mask, ws)
                            : grow_regions(depth, of, same, options, mask, ws);
    };
    for (const PixelIndex& seed : seeds) {
      const auto whole = grow({&seed, 1}, 1);
      if (whole.regions == 0) continue;
      // Rather more than its share, and rather less; the other seeds are looked at first, or not.
      const double share = static_cast<double>(whole.pixels) / static_cast<double>(valid);
      for (const double limit :
           {share - 0.5 / static_cast<double>(valid), share + 0.5 / static_cast<double>(valid)}) {
        CHECK(grow({&seed, 1}, limit).regions_leaked == (limit < share ? 1 : 0));
      }
    }
    // All at once: each region as it is alone.
    const double limit = rng.uniform(0.001, 0.6);
    std::size_t pixels = 0;
    int regions = 0, too_large = 0;
    Image<std::uint8_t> taken(w, h);
    for (const PixelIndex& seed : seeds) {
      if (taken(seed.u, seed.v) != 0) continue;
      const auto alone = grow({&seed, 1}, 1);
      for (int i = 0; i < w * h; ++i) taken.data()[i] = std::max(taken.data()[i], mask.data()[i]);
      if (alone.regions == 0) continue;
      const bool leaks = static_cast<double>(alone.pixels) > std::floor(limit * static_cast<double>(valid));
      too_large += leaks ? 1 : 0;
      regions += leaks ? 0 : 1;
      pixels += leaks ? 0 : alone.pixels;
    }
    const auto all = grow(seeds, limit);
    CHECK(all.regions == regions);
    CHECK(all.regions_leaked == too_large);
    CHECK(all.pixels == pixels);
    kept += regions;
    leaked += too_large;
  }
  CHECK(std::min(kept, leaked) > 10);
}

TEST_CASE("growing says that sizes differ instead of reading beyond them") {
  RegionGrowingWorkspace ws;
  Image<std::uint8_t> mask(8, 6, 7), small(4, 6);
  const std::vector<PixelIndex> seeds{{1, 1}};
  const Image<float> depth(8, 6, 1.0F);
  const auto span = std::span<const PixelIndex>(seeds);
  CHECK(grow_regions(depth, span, RelativeStep<float>{}, {}, small, ws).status ==
        RegionGrowingStatus::size_mismatch);
  CHECK_FALSE(grow_regions(depth, small, span, RelativeStep<float>{}, {}, mask, ws).ok());
  CHECK(mask(1, 1) == 7);
}

TEST_CASE_TEMPLATE("a criterion sees the pixel: labels, normals, anything", S, float, double) {
  // Two people side by side at the same depth, as a network labels them, before a wall.
  Image<S> depth(60, 40, S(3));
  Image<std::uint16_t> instances(60, 40);
  for (int v = 10; v < 30; ++v) {
    for (int u = 10; u < 50; ++u) {
      depth(u, v) = S(1.5);
      instances(u, v) = static_cast<std::uint16_t>(u < 30 ? 1 : 2);
    }
  }
  RegionGrowingWorkspace ws;
  Image<std::uint8_t> mask(60, 40);
  const std::vector<PixelIndex> seeds{{15, 15}};
  const auto span = std::span<const PixelIndex>(seeds);
  const RelativeStep<S> step;
  CHECK(grow_regions(depth, span, step, {}, mask, ws).pixels == 800);
  CHECK(grow_regions(depth, span, SameLabelStep(instances, step), {}, mask, ws).pixels == 400);
  CHECK(mask(29, 15) == 255);
  CHECK(mask(30, 15) == 0);
  const auto left_of = [&](const GrowingSite<S>& from, const GrowingSite<S>& to) {
    return from.u < 20 && to.u < 20 && step(from.depth, to.depth);
  };
  CHECK(grow_regions(depth, span, left_of, {}, mask, ws).pixels == 200);
}

TEST_CASE_TEMPLATE("normals stop growing where a board stands on the floor at one depth", S, float, double) {
  // A floor 1 m below the camera and a board that stands on it at 3 m: along their line no depth steps.
  const Pinhole<S> camera(S(100), S(100), S(79.5), S(59.5));
  Image<S> depth(160, 120);
  for (int v = 0; v < 120; ++v) {
    for (int u = 0; u < 160; ++u) {
      const S floor = v > 60 ? S(100) / (S(v) - S(59.5)) : S(100);
      depth(u, v) = std::min(floor, u > 50 && u < 110 ? S(3) : S(4));
    }
  }
  Image<Eigen::Matrix<S, 3, 1>> normals(160, 120, Eigen::Matrix<S, 3, 1>::Zero());
  surface_normals(camera, depth, NormalOptions<S>{}, normals);
  CHECK(normals(80, 40).dot(Eigen::Matrix<S, 3, 1>(0, 0, -1)) == doctest::Approx(1));
  CHECK(normals(80, 110).dot(Eigen::Matrix<S, 3, 1>(0, -1, 0)) == doctest::Approx(1));
  CHECK(normals(0, 0).hasNaN());
  CHECK(normals(51, 40).hasNaN());  // at the edge
  RegionGrowingWorkspace ws;
  Image<std::uint8_t> mask(160, 120);
  const std::vector<PixelIndex> seeds{{80, 40}};
  const auto span = std::span<const PixelIndex>(seeds);
  RegionGrowingOptions options;
  options.max_region_fraction = options.max_total_fraction = 1;
  const RelativeStep<S> step{S(0.05), S(0.005)};
  grow_regions(depth, span, step, options, mask, ws);
  CHECK(mask(80, 115) == 255);  // depth alone runs down the floor
  grow_regions(depth, span, SmoothSurfaceStep(normals, S(0.2), step), options, mask, ws);
  CHECK(mask(80, 88) == 255);
  CHECK(mask(80, 105) == 0);
  CHECK(mask(10, 115) == 0);
}

TEST_CASE("growing on an image without pixels gives nothing") {
  RegionGrowingWorkspace ws;
  const std::vector<PixelIndex> seeds{{0, 0}};
  for (const auto& [w, h] : {std::pair{5, 0}, std::pair{0, 5}, std::pair{0, 0}}) {
    Image<std::uint8_t> mask(w, h);
    const auto result = grow_regions(Image<float>(w, h), std::span<const PixelIndex>(seeds),
                                     RelativeStep<float>{}, {}, mask, ws);
    CHECK(result.ok());
    CHECK(result.regions == 0);
  }
}

TEST_CASE("a diagonal is a way for eight neighbours, none for four; the rim is never passed") {
  Image<double> depth(7, 5, 0.0);  // invalid
  for (int i = 0; i < 5; ++i) depth(i, i) = 1.0;
  depth(6, 0) = depth(0, 4) = 1.0;  // beyond the rim they would be neighbours
  RegionGrowingWorkspace ws;
  Image<std::uint8_t> mask(7, 5);
  const std::vector<PixelIndex> seeds{{0, 0}};
  const auto span = std::span<const PixelIndex>(seeds);
  RegionGrowingOptions options;
  options.max_region_fraction = options.max_total_fraction = 1;
  CHECK(grow_regions(depth, span, RelativeStep<double>{}, options, mask, ws).pixels == 1);
  options.connectivity = Connectivity::eight;
  CHECK(grow_regions(depth, span, RelativeStep<double>{}, options, mask, ws).pixels == 5);
  CHECK(mask(6, 0) == 0);
  CHECK(mask(0, 4) == 0);
}
