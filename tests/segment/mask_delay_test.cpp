// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/segment/mask_delay.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "dynslam/image/image.hpp"
#include "moving_scene.hpp"

using namespace dynslam;

namespace {

constexpr int kDelayWidth = 320, kDelayHeight = 240;
using Mask = Image<std::uint8_t>;
const Mask kNoPrior;

enum class Paint { blobs, plain, stripes };

/// Grey value of a body or of the wall behind it, at a place of its own.
double painted(Paint paint, int x, int y, std::uint64_t seed) {
  if (paint == Paint::plain) return 120;
  if (paint == Paint::stripes) return x / 8 % 2 == 0 ? 60 : 180;
  return test::blob_texture(x, y, seed);
}

struct Box {
  int u, v, width, height;
  [[nodiscard]] bool has(int x, int y) const { return x >= u && x < u + width && y >= v && y < v + height; }
};

/// A painted box before a wall of blobs, and where it is.
template <class Pixel>
struct Picture {
  Image<Pixel> gray{kDelayWidth, kDelayHeight};
  HalvingPyramid<Pixel> pyramid;
  Mask mask{kDelayWidth, kDelayHeight, 0};
  Picture(const Box& box, Paint paint, int lighter = 0) {
    for (int v = 0; v < kDelayHeight; ++v) {
      for (int u = 0; u < kDelayWidth; ++u) {
        const bool on = box.has(u, v);
        gray(u, v) = static_cast<Pixel>(
            (on ? painted(paint, u - box.u, v - box.v, 1) : painted(Paint::blobs, u, v, 2)) + lighter);
        mask(u, v) = on ? 255 : 0;
      }
    }
    pyramid.build(gray, 4);
  }
};

std::vector<PixelRun> rows_of(const Box& box) {
  std::vector<PixelRun> runs;
  for (int v = std::max(0, box.v); v < std::min(kDelayHeight, box.v + box.height); ++v)
    runs.push_back({v, std::max(0, box.u), std::min(kDelayWidth, box.u + box.width)});
  return runs;
}

constexpr Box kBox{120, 80, 70, 60};
Box moved(const Box& box, int x, int y) {
  return {box.u + x, box.v + y, box.width, box.height};
}

std::size_t different(const Mask& a, const Mask& b) {
  std::size_t n = 0;
  for (int v = 0; v < a.height(); ++v)
    for (int u = 0; u < a.width(); ++u) n += (a(u, v) != 0) != (b(u, v) != 0) ? 1U : 0U;
  return n;
}

}  // namespace

TEST_CASE_TEMPLATE("how far a body has moved in the picture is found to a pixel of the second level", Pixel,
                   std::uint8_t, std::uint16_t, float) {
  MaskDelayWorkspace workspace;
  const Picture<Pixel> last(kBox, Paint::blobs);
  for (const Eigen::Vector2i& step : {Eigen::Vector2i(0, 0), {12, -6}, {-25, 17}, {7, 30}, {-1, 3}}) {
    CAPTURE(step.transpose());
    const Box box = moved(kBox, step.x(), step.y());
    for (const int lighter : {0, 40}) {  // the exposure may change
      const Picture<Pixel> present(box, Paint::blobs, lighter);
      const auto motion = image_motion(last.pyramid, present.pyramid, std::span<const PixelRun>(rows_of(box)),
                                       MaskDelayOptions{}, workspace);
      REQUIRE(motion.has_value());
      CHECK((*motion - step.cast<double>()).cwiseAbs().maxCoeff() <= 2);
    }
  }
}

TEST_CASE(
    "what tells nothing has no motion: no texture, the same one again and again, no pixels, another size") {
  MaskDelayWorkspace workspace;
  const MaskDelayOptions options;
  // The middle of a large body: its rim would tell.
  const auto motion_of_middle = [&](Paint paint) {
    const Picture<std::uint8_t> last({60, 20, 200, 200}, paint), present({80, 20, 200, 200}, paint);
    return image_motion(last.pyramid, present.pyramid, std::span<const PixelRun>(rows_of({130, 70, 80, 100})),
                        options, workspace);
  };
  CHECK(motion_of_middle(Paint::blobs).has_value());
  CHECK_FALSE(motion_of_middle(Paint::plain).has_value());
  CHECK_FALSE(motion_of_middle(Paint::stripes).has_value());
  const std::vector<PixelRun> nothing;
  const Picture<std::uint8_t> any(kBox, Paint::blobs);
  CHECK_FALSE(image_motion(any.pyramid, any.pyramid, std::span<const PixelRun>(nothing), options, workspace)
                  .has_value());
  HalvingPyramid<std::uint8_t> smaller;
  smaller.build(Mask(kDelayWidth / 2, kDelayHeight, 0), 4);
  CHECK_FALSE(image_motion(smaller, any.pyramid, std::span<const PixelRun>(rows_of(kBox)), options, workspace)
                  .has_value());
}

TEST_CASE("a mask of the depth image covers a mover where the colour image has it, too") {
  MaskDelayWorkspace workspace;
  const MaskDelayOptions options;
  constexpr int kX = 16, kY = -8;  // in a frame
  const Picture<std::uint8_t> last(kBox, Paint::blobs), present(moved(kBox, kX, kY), Paint::blobs);
  for (const double delay : {-0.5, 0.25, 1.0}) {
    CAPTURE(delay);
    const Box in_depth = moved(kBox, static_cast<int>((1 + delay) * kX), static_cast<int>((1 + delay) * kY));
    const Picture<std::uint8_t> depth(in_depth, Paint::blobs);
    Mask covering = depth.mask, wanted = depth.mask;
    for (int v = 0; v < kDelayHeight; ++v)
      for (int u = 0; u < kDelayWidth; ++u) wanted(u, v) = std::max(wanted(u, v), present.mask(u, v));
    CHECK(cover_delay(last.pyramid, present.pyramid, depth.mask, kNoPrior, delay, options, covering.view(),
                      workspace) == 1);
    CHECK(different(depth.mask, wanted) > 300);
    // The motion is good to 2 pixels: as much may be wrong along the rim.
    CHECK(different(covering, wanted) <= 2 * 2 * (kBox.width + kBox.height) * std::abs(delay));
  }
}

TEST_CASE(
    "a mask stays as it is without a delay, at rest, for parts that are small, and where sizes differ") {
  MaskDelayWorkspace workspace;
  const MaskDelayOptions options;
  const Box box = moved(kBox, 16, -8);
  const Picture<std::uint8_t> last(kBox, Paint::blobs), present(box, Paint::blobs);
  Mask covering = present.mask;
  const auto unchanged = [&](const Picture<std::uint8_t>& before, double delay, const MaskDelayOptions& o) {
    const bool none = cover_delay(before.pyramid, present.pyramid, present.mask, kNoPrior, delay, o,
                                  covering.view(), workspace) == 0;
    return none && different(covering, present.mask) == 0;
  };
  CHECK(unchanged(last, 0, options));
  CHECK(unchanged(present, 0.5, options));
  CHECK(unchanged(last, 0.5, {.reach = 0}));
  CHECK(unchanged(last, 0.5, {.least = 0.5}));
  CHECK_FALSE(unchanged(last, 0.5, options));
  Mask small(kDelayWidth / 2, kDelayHeight, 0);
  CHECK(cover_delay(last.pyramid, present.pyramid, present.mask, kNoPrior, 0.5, options, small.view(),
                    workspace) == 0);
  const HalvingPyramid<std::uint8_t> none;
  CHECK(cover_delay(none, present.pyramid, present.mask, kNoPrior, 0.5, options, covering.view(),
                    workspace) == 0);
}

TEST_CASE("what a mask of the colour image covers needs no other") {
  MaskDelayWorkspace workspace;
  const Box box = moved(kBox, 16, -8);
  const Picture<std::uint8_t> last(kBox, Paint::blobs), present(box, Paint::blobs);
  for (const double share : {0.4, 0.6}) {
    Mask prior(kDelayWidth, kDelayHeight, 0), covering = present.mask;
    for (int v = box.v; v < box.v + box.height; ++v)
      for (int u = box.u; u < box.u + share * box.width; ++u) prior(u, v) = 1;
    CHECK(cover_delay(last.pyramid, present.pyramid, present.mask, prior, 0.5, {}, covering.view(),
                      workspace) == (share < 0.5 ? 1 : 0));
  }
}

TEST_CASE("each part of a mask goes its own way, and what leaves the image is cut off") {
  MaskDelayWorkspace workspace;
  constexpr Box kLeft{2, 20, 60, 60}, kRight{200, 120, 60, 60};
  Picture<std::uint8_t> last(kLeft, Paint::blobs), present(moved(kLeft, -20, 0), Paint::blobs);
  for (int v = 0; v < 60; ++v) {
    for (int u = 0; u < 60; ++u) {
      const auto grey = static_cast<std::uint8_t>(painted(Paint::blobs, u, v, 7));
      last.gray(kRight.u + u, kRight.v + v) = grey;
      present.gray(kRight.u + u, kRight.v + v + 20) = grey;
      present.mask(kRight.u + u, kRight.v + v + 20) = 255;
    }
  }
  last.pyramid.build(last.gray, 4);
  present.pyramid.build(present.gray, 4);
  Mask covering = present.mask;
  // Depth before colour by half a frame: colour has them half a step further on.
  CHECK(cover_delay(last.pyramid, present.pyramid, present.mask, kNoPrior, -0.5, {}, covering.view(),
                    workspace) == 2);
  for (const auto& [u, v] : {std::pair{230, 205}, {230, 150}, {10, 50}}) CHECK(covering(u, v) == 255);
  for (const auto& [u, v] : {std::pair{230, 215}, {265, 170}, {60, 50}, {319, 50}, {230, 135}})
    CHECK(covering(u, v) == 0);
}
