// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/segment/mask_completion.hpp"

#include <doctest/doctest.h>

#include <limits>
#include <random>

#include "dynslam/image/image.hpp"
#include "dynslam/segment/growing_criteria.hpp"

using namespace dynslam;

namespace {

constexpr int kMaskWidth = 64, kMaskHeight = 48;
using Mask = Image<std::uint8_t>;

void fill(Mask& mask, int u0, int v0, int u1, int v1) {
  for (int v = v0; v < v1; ++v)
    for (int u = u0; u < u1; ++u) mask(u, v) = 255;
}

std::size_t count(const Mask& mask) {
  return static_cast<std::size_t>(std::count(mask.data(), mask.data() + mask.width() * mask.height(), 255));
}

/// What complete_unmeasured() promises, by the plainest shortest ways.
class OracleOfWays {
 public:
  OracleOfWays(const Image<std::uint8_t>& gray, const Image<float>& depth, const Mask& mask, double level)
      : gray_(gray), depth_(depth), mask_(mask), level_(level) {}

  [[nodiscard]] Mask decide(double limit) const {
    const auto to_mask = ways(
        true, [&](int, int) { return true; }, limit);
    const auto near = [&](int u, int v) { return mask_(u, v) != 0 || to_mask(u, v) <= limit; };
    const auto to_rest = ways(false, near, limit);
    Mask out = mask_;
    for (int v = 0; v < kMaskHeight; ++v) {
      for (int u = 0; u < kMaskWidth; ++u) {
        if (is_valid_depth(depth_(u, v))) continue;
        if (to_mask(u, v) < to_rest(u, v)) out(u, v) = 255;
        if (to_mask(u, v) > to_rest(u, v)) out(u, v) = 0;
      }
    }
    return out;
  }

 private:
  template <class Near>
  [[nodiscard]] Image<double> ways(bool from_mask, const Near& near, double limit) const {
    Image<double> cost(kMaskWidth, kMaskHeight, std::numeric_limits<double>::infinity());
    for (int v = 0; v < kMaskHeight; ++v)
      for (int u = 0; u < kMaskWidth; ++u)
        if (is_valid_depth(depth_(u, v)) && (mask_(u, v) != 0) == from_mask) cost(u, v) = 0;
    for (bool changed = true; changed;) {
      changed = false;
      for (int v = 0; v < kMaskHeight; ++v) {
        for (int u = 0; u < kMaskWidth; ++u) {
          if (is_valid_depth(depth_(u, v)) || !near(u, v)) continue;
          const int beside[4][2] = {{u - 1, v}, {u + 1, v}, {u, v - 1}, {u, v + 1}};
          for (const auto& [x, y] : beside) {
            if (x < 0 || y < 0 || x >= kMaskWidth || y >= kMaskHeight) continue;
            const double sum = cost(x, y) + 4 + level_ * std::abs(int{gray_(u, v)} - int{gray_(x, y)});
            if (sum > limit || sum >= cost(u, v)) continue;
            cost(u, v) = sum;
            changed = true;
          }
        }
      }
    }
    return cost;
  }

  const Image<std::uint8_t>& gray_;
  const Image<float>& depth_;
  const Mask& mask_;
  double level_;
};

}  // namespace

TEST_CASE("pixels without depth go with what looks alike, on the mask or beside it") {
  // A dark head of 12 x 12 on a mover whose depth ends below it, before a bright wall: the head has no depth,
  // and as the shadow of the sensor's lamp the wall beside the mover has none either.
  Image<std::uint8_t> gray(kMaskWidth, kMaskHeight, 200);
  Image<float> depth(kMaskWidth, kMaskHeight, 3.0F);
  Mask mask(kMaskWidth, kMaskHeight, 0), truth(kMaskWidth, kMaskHeight, 0);
  for (int v = 8; v < 40; ++v)
    for (int u = 14; u < 44; ++u) depth(u, v) = 0;
  fill(truth, 20, 20, 40, 40);
  fill(truth, 24, 8, 36, 20);
  for (int v = 8; v < 40; ++v)
    for (int u = 20; u < 40; ++u)
      if (truth(u, v) != 0) gray(u, v) = 40;
  for (int v = 20; v < 40; ++v)
    for (int u = 22; u < 38; ++u) depth(u, v) = 1.5F;
  fill(mask, 22, 20, 38, 40);
  UnmeasuredWorkspace workspace;
  complete_unmeasured(gray, depth, mask.view(), {.reach = 0.25}, workspace);
  for (int v = 0; v < kMaskHeight; ++v) {
    for (int u = 0; u < kMaskWidth; ++u) {
      CAPTURE(u);
      CAPTURE(v);
      REQUIRE(mask(u, v) == truth(u, v));
    }
  }
  // Farther than its reach it goes nowhere.
  Mask some(kMaskWidth, kMaskHeight, 0);
  fill(some, 22, 20, 38, 40);
  complete_unmeasured(gray, depth, some.view(), {.reach = 3.0 / kMaskWidth}, workspace);
  CHECK(some(30, 17) == 255);
  CHECK(some(30, 16) == 0);
  Mask none(kMaskWidth, kMaskHeight, 0);
  complete_unmeasured(gray, depth, none.view(), {}, workspace);
  CHECK(count(none) == 0);
}

TEST_CASE("pixels without depth are decided as the plainest shortest ways decide") {
  std::mt19937 rng(7);
  UnmeasuredWorkspace workspace;
  for (int scene = 0; scene < 20; ++scene) {
    CAPTURE(scene);
    Image<std::uint8_t> gray(kMaskWidth, kMaskHeight, 0);
    Image<float> depth(kMaskWidth, kMaskHeight, 2.0F);
    Mask mask(kMaskWidth, kMaskHeight, 0);
    for (int i = 0; i < kMaskWidth * kMaskHeight; ++i) gray.data()[i] = static_cast<std::uint8_t>(rng() % 12);
    const auto box = [&](const auto& set) {
      const int u0 = static_cast<int>(rng() % 50), v0 = static_cast<int>(rng() % 36);
      const int u1 = u0 + 4 + static_cast<int>(rng() % 10), v1 = v0 + 4 + static_cast<int>(rng() % 8);
      for (int v = v0; v < v1; ++v)
        for (int u = u0; u < u1; ++u) set(u, v);
    };
    for (int k = 0; k < 4; ++k) box([&](int u, int v) { mask(u, v) = 255; });
    for (int k = 0; k < 12; ++k) box([&](int u, int v) { depth(u, v) = 0; });
    for (int k = 0; k < 6; ++k)
      box([&](int u, int v) { gray(u, v) = static_cast<std::uint8_t>(gray(u, v) + 60); });
    const Mask before = mask;
    // 12 px of 4 each; an edge of 24 grey levels costs as much: 2 per level.
    complete_unmeasured(gray, depth, mask.view(), {.reach = 12.0 / kMaskWidth, .contrast = 24}, workspace);
    const Mask expected = OracleOfWays(gray, depth, before, 2).decide(48);
    CHECK(std::equal(mask.data(), mask.data() + kMaskWidth * kMaskHeight, expected.data()));
    CHECK(count(mask) != count(before));
  }
}
