// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/segment/detail/growing_field.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "allocations.hpp"
#include "dynslam/segment/mask.hpp"
#include "dynslam/segment/region_growing.hpp"
#include "image_kinds.hpp"
#include "pixels.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

/// Surfaces with steps between them, noise that now and then is a step, and every kind of invalid depth.
template <class S>
Image<S> random_depth(test::Rng& rng, int w, int h, double noise) {
  constexpr S kMax = std::numeric_limits<S>::max(), kInfinity = std::numeric_limits<S>::infinity();
  constexpr std::array kOdd{S(0),       S(-1), std::numeric_limits<S>::quiet_NaN(), kInfinity,
                            -kInfinity, kMax,  std::numeric_limits<S>::denorm_min()};
  Image<S> depth(w, h);
  for (int v = 0; v < h; ++v) {
    for (int u = 0; u < w; ++u) {
      depth(u, v) = S(1 + 0.1 * ((u / 23 + v / 7) % 3) + (rng.chance(noise) ? 0.05 * rng.uniform() : 0));
      if (rng.chance(noise / 4)) depth(u, v) = kOdd[static_cast<std::size_t>(rng.integer(0, 6))];
    }
  }
  return depth;
}

/// Depths that wander along the rows in steps of at most 0.03, also through zero, and jump now and then.
template <class S>
Image<S> wandering_depth(test::Rng& rng, int w, int h, double noise) {
  Image<S> depth(w, h);
  for (int v = 0; v < h; ++v) {
    S z = S(rng.uniform(-0.1, 1));
    for (int u = 0; u < w; ++u) {
      z += S(rng.uniform(-0.031, 0.03));
      if (rng.chance(noise / 4)) z = S(rng.uniform(-0.1, 1));
      depth(u, v) = rng.chance(noise / 8) ? S(0) : z;
    }
  }
  return depth;
}

/// Growing as one writes it down: pixel after pixel, with a queue.
template <class S, class Criterion>
struct Oracle {
  const Image<S>& depth;
  const Image<std::uint8_t>& barrier;
  Connectivity connectivity;
  const Criterion& criterion;
  Image<std::uint8_t> visited{depth.width(), depth.height()};

  bool open(const PixelIndex& p) const {
    return depth.contains(p.u, p.v) && visited(p.u, p.v) == 0 && barrier(p.u, p.v) == 0 &&
           is_valid_depth(depth(p.u, p.v));
  }
  std::vector<PixelIndex> region(const PixelIndex& seed) {
    std::vector<PixelIndex> found;
    if (!open(seed)) return found;
    visited(seed.u, seed.v) = 1;
    found.push_back(seed);
    for (std::size_t head = 0; head < found.size(); ++head) {
      const PixelIndex p = found[head];
      for (int dv = -1; dv <= 1; ++dv) {
        for (int du = -1; du <= 1; ++du) {
          if (connectivity == Connectivity::four && du * dv != 0) continue;
          const PixelIndex q{p.u + du, p.v + dv};
          if (!open(q) || !may_step(criterion, GrowingSite<S>{p.u, p.v, depth(p.u, p.v)},
                                    GrowingSite<S>{q.u, q.v, depth(q.u, q.v)}))
            continue;
          visited(q.u, q.v) = 1;
          found.push_back(q);
        }
      }
    }
    return found;
  }
};

struct Case {
  int w, h;
  double noise;
};
const std::vector<Case> kCases{{1, 1, 0.2},     {1, 70, 0.2},   {70, 1, 0.1},  {63, 5, 0},
                               {64, 5, 0},      {65, 9, 0.02},  {128, 6, 0},   {129, 20, 0.05},
                               {200, 31, 0.01}, {200, 31, 0.3}, {192, 30, 0.9}};

/// Compares regions, flags and counts with the oracle's, over sizes, barriers, connectivities and limits.
template <class Kind, class S, class Criterion>
void compare(test::Rng& rng, const Criterion& criterion,
             Image<S> (&make_depth)(test::Rng&, int, int, double) = random_depth<S>) {
  RegionGrowingWorkspace ws;
  int kept = 0;
  for (const Case& one : kCases) {
    const int w = one.w, h = one.h;
    const double noise = one.noise;
    const auto depth = make_depth(rng, w, h, noise);
    Image<std::uint8_t> barrier(w, h);
    const bool closes = rng.chance(0.5);
    for (int v = 0; v < h && closes; ++v) {
      for (int u = 0; u < w; ++u) barrier(u, v) = rng.chance(0.02) ? 3 : 0;
    }
    std::vector<PixelIndex> seeds;
    for (int i = 0; i < 12; ++i) seeds.push_back({rng.integer(-1, w), rng.integer(-1, h)});
    for (const Connectivity connectivity : {Connectivity::four, Connectivity::eight}) {
      RegionGrowingOptions options;
      options.connectivity = connectivity;
      options.max_total_fraction = 1;
      options.max_region_fraction = rng.chance(0.5) ? 1 : 0.3;
      options.min_region_pixels = 3;
      Oracle<S, Criterion> oracle{depth, barrier, connectivity, criterion};
      std::size_t valid = 0, pixels = 0;
      for (int i = 0; i < w * h; ++i) valid += is_valid_depth(depth.data()[i]) ? 1U : 0U;
      Image<std::uint8_t> expected(w, h);
      int regions = 0, leaked = 0, small = 0;
      for (const PixelIndex& seed : seeds) {
        const auto found = oracle.region(seed);
        if (found.empty()) continue;
        const bool large =
            static_cast<double>(found.size()) > options.max_region_fraction * static_cast<double>(valid);
        const bool keeps = !large && found.size() >= 3;
        ++(keeps ? regions : large ? leaked : small);
        if (!keeps) continue;
        pixels += found.size();
        for (const PixelIndex& p : found) expected(p.u, p.v) = 255;
      }
      CAPTURE(w);
      CAPTURE(h);
      CAPTURE(noise);
      CAPTURE(closes);
      const auto z = Kind::make(depth);
      const auto closed = Kind::make(barrier);
      auto mask = Kind::make(Image<std::uint8_t>(w, h, 9));
      const auto span = std::span<const PixelIndex>(seeds);
      const auto result =
          grow_regions(Kind::in(z), Kind::in(closed), span, criterion, options, Kind::out(mask), ws);
      CHECK(result.regions == regions);
      CHECK(result.regions_leaked == leaked);
      CHECK(result.regions_small == small);
      CHECK(result.pixels == pixels);
      CHECK(test::pixels_of(Kind::in(mask)) == test::pixels(expected));
      kept += regions;
      if (closes) continue;
      grow_regions(Kind::in(z), span, criterion, options, Kind::out(mask), ws);
      CHECK(test::pixels_of(Kind::in(mask)) == test::pixels(expected));
    }
  }
  CHECK(kept > 20);
}

}  // namespace

TEST_CASE_TEMPLATE("growing by runs finds what growing by pixels finds", S, float, double) {
  test::Rng rng("growing by runs");
  const RelativeStep<S> relative{S(0.02), S(0.005)};
  const FixedStep<S> fixed{S(0.03)};
  for (int round = 0; round < 3; ++round) {
    compare<test::OwnedKind, S>(rng, relative);
    compare<test::OwnedKind, S>(rng, fixed);
    compare<test::ViewKind, S>(rng, relative);
    compare<test::PlainKind, S>(rng, fixed);
    compare<test::ColumnMajorKind, S>(rng, relative);
  }
}

TEST_CASE_TEMPLATE("a largest step leads from depths that are valid to none that are not", S, float, double) {
  static_assert(BoundedLaneCriterion<FixedStep<S>, S> && !BoundedLaneCriterion<RelativeStep<S>, S>);
  test::Rng rng("largest step");
  for (const double step : {0.03, 0.012, 0.06}) {
    CAPTURE(step);
    for (int round = 0; round < 4; ++round)
      compare<test::OwnedKind, S>(rng, FixedStep<S>{S(step)}, wandering_depth<S>);
  }
}

TEST_CASE_TEMPLATE("holes of any width are found wherever they begin, and no seed lies in one", S, float, double) {
  constexpr int kWidth = 200;
  RegionGrowingOptions options;
  options.max_region_fraction = options.max_total_fraction = 1;
  RegionGrowingWorkspace ws;
  Image<std::uint8_t> mask(kWidth, 1);
  for (int begin = 1; begin < 140; ++begin) {
    for (int end = begin + 1; end < begin + 40; ++end) {
      const std::vector<PixelIndex> seeds{{0, 0}, {begin, 0}, {kWidth - 1, 0}};
      Image<S> depth(kWidth, 1, S(1));
      std::fill(depth.data() + begin, depth.data() + end, S(0));
      grow_regions(depth, std::span<const PixelIndex>(seeds), FixedStep<S>{S(0.03)}, options, mask, ws);
      const bool right = std::equal(mask.data(), mask.data() + kWidth, depth.data(),
                                    [](std::uint8_t m, S z) { return m == (z > S(0) ? 255 : 0); });
      CAPTURE(begin);
      CAPTURE(end);
      REQUIRE(right);
    }
  }
}

TEST_CASE_TEMPLATE("a criterion that does not say so is never asked about invalid depths or closed pixels", S,
                   float, double) {
  test::Rng rng("guarded");
  bool asked = false;
  const auto by_depth = [&](S from, S to) {
    asked = asked || !is_valid_depth(from) || !is_valid_depth(to);
    return std::abs(from - to) < S(0.03);
  };
  compare<test::OwnedKind, S>(rng, by_depth);
  const auto by_site = [&](const GrowingSite<S>& from, const GrowingSite<S>& to) {
    asked = asked || !is_valid_depth(from.depth) || !is_valid_depth(to.depth);
    asked = asked || std::abs(from.u - to.u) > 1 || std::abs(from.v - to.v) > 1;
    return from.u / 50 == to.u / 50 && from.v / 9 == to.v / 9;
  };
  compare<test::OwnedKind, S>(rng, by_site);
  CHECK_FALSE(asked);
}

TEST_CASE("growing, components and morphology take no memory once they have run") {
  if (!test::counts_allocations()) return;
  test::Rng rng("memory of growing");
  const auto depth = random_depth<float>(rng, 200, 60, 0.05);
  Image<std::uint8_t> mask(200, 60), noise(200, 60);
  for (int i = 0; i < 200 * 60; ++i) noise.data()[i] = rng.chance(0.4) ? 1 : 0;
  const std::vector<PixelIndex> seeds{{3, 3}, {100, 30}, {190, 50}};
  RegionGrowingWorkspace growing;
  MaskWorkspace morphology;
  Image<int> labels;
  std::vector<int> counts;
  const auto run = [&] {
    grow_regions(depth, std::span<const PixelIndex>(seeds), RelativeStep<float>{}, {}, mask, growing);
    dilate(noise, mask, 3, morphology);
    erode(mask, mask, 2, morphology);
    connected_components(noise, labels, counts, morphology);
    mask = noise;
    remove_small(mask, 4, morphology);
    fill_holes(mask, 9, morphology);
  };
  run();
  CHECK(test::allocations_of(run) == 0);
}
