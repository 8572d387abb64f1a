// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/segment/mask.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <utility>
#include <vector>

#include "pixels.hpp"
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
      CHECK(test::pixels(in_place) == test::pixels(grown));
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

TEST_CASE("holes of any size fill, and the outside never does") {
  MaskWorkspace ws;
  Image<std::uint8_t> mask(9, 7);
  for (int u = 2; u < 7; ++u) mask(u, 1) = mask(u, 5) = 255;
  for (int v = 1; v < 6; ++v) mask(2, v) = mask(6, v) = 255;
  fill_holes(mask.view(), std::numeric_limits<int>::max(), ws);  // the count of the outside once overflowed
  CHECK(mask(0, 0) == 0);
  CHECK(mask(8, 6) == 0);
  CHECK(std::count(mask.data(), mask.data() + 63, 255) == 25);
}

TEST_CASE("a ring of diagonal steps has an inside; its holes are 4-connected") {
  MaskWorkspace ws;
  Image<std::uint8_t> mask(9, 9);
  for (int v = 0; v < 9; ++v) {
    for (int u = 0; u < 9; ++u) mask(u, v) = std::abs(u - 4) + std::abs(v - 4) == 3 ? 255 : 0;
  }
  std::vector<int> counts;
  Image<int> labels;
  CHECK(connected_components(mask.view(), labels, counts, ws) == 1);
  CHECK(connected_components(mask.view(), Connectivity::four, labels, counts) == 12);
  fill_holes(mask.view(), 100, Connectivity::eight, ws);
  CHECK(mask(4, 4) == 0);  // on request a gap at a corner leaves it open
  fill_holes(mask.view(), 100, ws);
  for (int v = 0; v < 9; ++v) {
    for (int u = 0; u < 9; ++u) CHECK(mask(u, v) == (std::abs(u - 4) + std::abs(v - 4) <= 3 ? 255 : 0));
  }
}

TEST_CASE("images without pixels pass through every mask operation") {
  MaskWorkspace ws;
  for (const auto& [w, h] : {std::pair{5, 0}, std::pair{0, 5}, std::pair{0, 0}}) {
    Image<std::uint8_t> mask(w, h), out(w, h);
    dilate(mask.view(), out.view(), 2, ws);
    erode(mask.view(), out.view(), std::numeric_limits<int>::max(), ws);
    Image<int> labels;
    std::vector<int> counts;
    CHECK(connected_components(mask.view(), labels, counts, ws) == 0);
    remove_small(mask.view(), 3, ws);
    fill_holes(mask.view(), 3, ws);
  }
}
