// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/segment/keypoint_territories.hpp"

#include <doctest/doctest.h>

#include <deque>
#include <limits>
#include <random>

#include "dynslam/image/image.hpp"
#include "dynslam/segment/growing_criteria.hpp"

using namespace dynslam;

namespace {

constexpr int kRoomWidth = 60, kRoomHeight = 40;
constexpr RelativeStep<float> kSensorStep{0.03F, 0.01F};

struct Territories {
  Image<int> parts;
  TerritoryWorkspace workspace;
  int count = 0;
  Territories(const Image<float>& depth, const std::vector<VerdictSite>& sites,
              const TerritoryOptions& options) {
    count = keypoint_territories(depth, std::span<const VerdictSite>(sites), kSensorStep, options, parts,
                                 workspace);
  }
};

/// Steps over the surface from a keypoint to every pixel, by the plainest search; -1: out of reach.
Image<int> steps_from(const Image<float>& depth, const VerdictSite& site, int reach) {
  Image<int> steps(depth.width(), depth.height(), -1);
  std::deque<PixelIndex> open{{site.u, site.v}};
  steps(site.u, site.v) = 0;
  while (!open.empty()) {
    const PixelIndex p = open.front();
    open.pop_front();
    if (steps(p.u, p.v) == reach) continue;
    for (int v = std::max(0, p.v - 1); v <= std::min(depth.height() - 1, p.v + 1); ++v) {
      for (int u = std::max(0, p.u - 1); u <= std::min(depth.width() - 1, p.u + 1); ++u) {
        if ((u != p.u) == (v != p.v) || steps(u, v) >= 0 || !is_valid_depth(depth(u, v)) ||
            !kSensorStep(depth(p.u, p.v), depth(u, v)))
          continue;
        steps(u, v) = steps(p.u, p.v) + 1;
        open.push_back({u, v});
      }
    }
  }
  return steps;
}

}  // namespace

TEST_CASE("a pixel belongs to the keypoint that is nearest over its surface") {
  std::mt19937 random(7);
  std::uniform_int_distribution<int> across(0, kRoomWidth - 1), down(0, kRoomHeight - 1);
  int decided = 0;
  for (int trial = 0; trial < 20; ++trial) {
    Image<float> depth(kRoomWidth, kRoomHeight, 2.0F);
    for (int k = 0; k < 6; ++k) {  // walls to go around: another surface, or none
      const int u = across(random), v = down(random);
      for (int n = 0; n < 15; ++n)
        depth(std::min(kRoomWidth - 1, u + (k % 2) * n), std::min(kRoomHeight - 1, v + (1 - k % 2) * n)) =
            k < 3 ? 1.0F : std::numeric_limits<float>::quiet_NaN();
    }
    std::vector<VerdictSite> sites;
    std::vector<Image<int>> steps;
    constexpr int kReach = 14;
    while (sites.size() < 12) {
      const VerdictSite s{across(random), down(random), sites.size() % 2 == 0};
      if (!is_valid_depth(depth(s.u, s.v))) continue;
      sites.push_back(s);
      steps.push_back(steps_from(depth, s, kReach));
    }
    const Territories found(depth, sites, {kReach, 1});
    for (int v = 0; v < kRoomHeight; ++v) {
      for (int u = 0; u < kRoomWidth; ++u) {
        int moving = kReach + 1, still = kReach + 1;
        for (std::size_t k = 0; k < sites.size(); ++k) {
          if (steps[k](u, v) < 0) continue;
          int& nearest = sites[k].moving ? moving : still;
          nearest = std::min(nearest, steps[k](u, v));
        }
        if (moving == still && moving <= kReach) continue;  // either may have it
        REQUIRE((found.parts(u, v) != 0) == (moving < still));
        ++decided;
      }
    }
  }
  CHECK(decided > 20 * kRoomWidth * kRoomHeight / 2);
}

TEST_CASE("too few keypoints make no surface move, wherever else there are more") {
  const Image<float> depth(kRoomWidth, kRoomHeight, 2.0F);
  std::vector<VerdictSite> sites;
  for (int k = 0; k < 5; ++k) sites.push_back({5 + 2 * k, 8, true});    // together
  for (int k = 0; k < 4; ++k) sites.push_back({40 + 2 * k, 30, true});  // and elsewhere
  const auto area = [](const Territories& t) {
    return std::count_if(t.parts.data(), t.parts.data() + kRoomWidth * kRoomHeight,
                         [](int p) { return p != 0; });
  };
  const Territories five(depth, sites, {4, 5});
  CHECK(five.parts(9, 8) != 0);
  CHECK(five.parts(43, 30) == 0);
  CHECK(area(Territories(depth, sites, {4, 4})) > area(five));
  CHECK(area(Territories(depth, sites, {4, 6})) == 0);
  CHECK(area(Territories(depth, sites, {0, 1})) == 0);
  CHECK(Territories(depth, {}, {4, 1}).count == 0);
}

TEST_CASE("keypoints at rest keep their part of a surface that somebody touches") {
  const Image<float> depth(kRoomWidth, kRoomHeight, 2.0F);
  std::vector<VerdictSite> sites;
  for (int v = 4; v < kRoomHeight; v += 8) {
    sites.push_back({20, v, true});
    sites.push_back({40, v, false});
  }
  const Territories found(depth, sites, {30, 3});
  CHECK(found.count == 1);
  for (int v = 0; v < kRoomHeight; ++v) {
    CHECK(found.parts(28, v) != 0);
    CHECK(found.parts(32, v) == 0);
  }
}
