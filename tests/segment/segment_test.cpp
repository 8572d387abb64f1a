// SPDX-License-Identifier: BSD-3-Clause
#include <doctest/doctest.h>

#include <algorithm>
#include <limits>
#include <set>
#include <vector>

#include "dynslam/segment/mask.hpp"
#include "dynslam/segment/region_growing.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

Image<std::uint8_t> random_mask(test::Rng& rng, int w, int h, double density) {
  Image<std::uint8_t> mask(w, h);
  for (int v = 0; v < h; ++v) {
    for (int u = 0; u < w; ++u) mask(u, v) = rng.chance(density) ? 255 : 0;
  }
  return mask;
}

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

std::vector<std::uint8_t> pixels(const Image<std::uint8_t>& image) {
  return {image.data(), image.data() + image.width() * image.height()};
}

}  // namespace

TEST_CASE("dilation and erosion equal brute force for any radius") {
  test::Rng rng("morphology");
  MaskWorkspace ws;
  for (const int radius : {0, 1, 3, 8, 40}) {
    for (const double density : {0.02, 0.5, 0.98}) {
      const auto in = random_mask(rng, 37, 23, density);
      Image<std::uint8_t> grown(37, 23), shrunk(37, 23);
      dilate(in.view(), grown.view(), radius, ws);
      erode(in.view(), shrunk.view(), radius, ws);
      bool equal = true;
      for (int v = 0; v < 23; ++v) {
        for (int u = 0; u < 37; ++u) {
          bool any = false, all = true;
          for (int y = std::max(0, v - radius); y <= std::min(22, v + radius); ++y) {
            for (int x = std::max(0, u - radius); x <= std::min(36, u + radius); ++x) {
              any = any || in(x, y) != 0;
              all = all && in(x, y) != 0;
            }
          }
          equal = equal && grown(u, v) == (any ? 255 : 0) && shrunk(u, v) == (all ? 255 : 0);
        }
      }
      CAPTURE(radius);
      CAPTURE(density);
      CHECK(equal);
      auto in_place = in;
      dilate(in_place.view(), in_place.view(), radius, ws);
      CHECK(pixels(in_place) == pixels(grown));
    }
  }
}

TEST_CASE("components equal a flood fill") {
  test::Rng rng("components");
  MaskWorkspace ws;
  for (const double density : {0.1, 0.4, 0.6}) {
    const auto mask = random_mask(rng, 41, 29, density);
    Image<int> labels;
    std::vector<int> counts;
    const int n = connected_components(mask.view(), labels, counts, ws);
    Image<int> flood(41, 29);
    int found = 0;
    for (int v = 0; v < 29; ++v) {
      for (int u = 0; u < 41; ++u) {
        if (mask(u, v) == 0 || flood(u, v) != 0) continue;
        ++found;
        int size = 0;
        std::vector<std::pair<int, int>> stack{{u, v}};
        flood(u, v) = found;
        while (!stack.empty()) {
          const auto p = stack.back();
          stack.pop_back();
          ++size;
          CHECK(labels(p.first, p.second) == found);  // numbered in the same order
          for (int dv = -1; dv <= 1; ++dv) {
            for (int du = -1; du <= 1; ++du) {
              const int x = p.first + du, y = p.second + dv;
              if (!mask.contains(x, y) || mask(x, y) == 0 || flood(x, y) != 0) continue;
              flood(x, y) = found;
              stack.emplace_back(x, y);
            }
          }
        }
        CHECK(counts[static_cast<std::size_t>(found)] == size);
      }
    }
    CHECK(n == found);
  }
}

TEST_CASE("small parts go, small holes close, large ones and open bays stay") {
  Image<std::uint8_t> mask(20, 20);
  for (int v = 2; v < 12; ++v) {
    for (int u = 2; u < 12; ++u) mask(u, v) = 255;
  }
  mask(5, 5) = 0;                                            // a hole of one pixel
  for (int v = 7; v < 11; ++v) mask(8, v) = mask(9, v) = 0;  // a hole of eight
  mask(16, 16) = 255;                                        // a speck
  MaskWorkspace ws;
  remove_small(mask.view(), 4, ws);
  CHECK(mask(16, 16) == 0);
  CHECK(mask(3, 3) == 255);
  fill_holes(mask.view(), 4, ws);
  CHECK(mask(5, 5) == 255);
  CHECK(mask(8, 8) == 0);
  CHECK(mask(0, 0) == 0);
}

TEST_CASE("a fixed step floods through the floor; the guard drops it, the relative step does not leak") {
  const auto depth = person_on_floor();
  RegionGrowingWorkspace ws;
  Image<std::uint8_t> mask(160, 120);
  const std::vector<PixelIndex> seed{{75, 60}};
  RegionGrowingOptions unguarded;
  unguarded.max_region_fraction = 1.0;
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
  const auto result = grow_regions(depth, std::span<const PixelIndex>(seeds), FixedStep<float>{0.06F}, {},
                                   mask.view(), ws, barrier.view());
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
    CHECK(pixels(first) == pixels(other));
  }
  for (int v = 0; v < 40; ++v) {
    for (int u = 0; u < 60; ++u) {
      if (first(u, v) != 0) CHECK(is_valid_depth(depth(u, v)));
    }
  }
}
