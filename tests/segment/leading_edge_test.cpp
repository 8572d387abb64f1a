// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/segment/leading_edge.hpp"

#include <doctest/doctest.h>

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "dynslam/image/image.hpp"
#include "dynslam/image/pyramid.hpp"
#include "dynslam/segment/connected_components.hpp"
#include "dynslam/segment/mask_delay.hpp"
#include "moving_scene.hpp"

using namespace dynslam;

namespace {

constexpr int kEdgeWidth = 320, kEdgeHeight = 240;
using EdgeMask = Image<std::uint8_t>;

/// A painted board of 160 x 100 pixels, turned, before a wall that stands.
template <class Pixel = std::uint8_t>
struct BoardView {
  HalvingPyramid<Pixel> pyramid;
  EdgeMask mask{kEdgeWidth, kEdgeHeight, 0};

  BoardView(const Eigen::Vector2d& middle, double angle) {  // [px, rad]
    Image<Pixel> gray(kEdgeWidth, kEdgeHeight);
    for (int v = 0; v < kEdgeHeight; ++v) {
      for (int u = 0; u < kEdgeWidth; ++u) {
        const Eigen::Vector2d d = Eigen::Vector2d(u, v) - middle;
        const double x = std::cos(angle) * d.x() + std::sin(angle) * d.y();
        const double y = -std::sin(angle) * d.x() + std::cos(angle) * d.y();
        mask(u, v) = std::abs(x) < 80 && std::abs(y) < 50 ? 255 : 0;
        gray(u, v) = static_cast<Pixel>(mask(u, v) != 0 ? test::blob_texture(x + 400, y + 400, 3)
                                                        : test::blob_texture(u, v, 5));
      }
    }
    pyramid.build(gray, 4);
  }

  [[nodiscard]] std::vector<PixelRun> runs() const {
    ComponentsWorkspace components;
    detail::number_runs(mask, false, Connectivity::eight, components);
    return components.runs;
  }
};

std::optional<Eigen::Vector2d> wall_stands(int u, int v) {
  return Eigen::Vector2d(u, v);
}

/// Pixels of `a` that are not in `b`.
int beyond(const EdgeMask& a, const EdgeMask& b) {
  int n = 0;
  for (int v = 0; v < kEdgeHeight; ++v)
    for (int u = 0; u < kEdgeWidth; ++u) n += a(u, v) != 0 && b(u, v) == 0 ? 1 : 0;
  return n;
}

}  // namespace

TEST_CASE_TEMPLATE("what a mover has ahead of its mask is found without knowing how late the mask is", Pixel,
                   std::uint8_t, std::uint16_t, float) {
  LeadingEdgeWorkspace workspace;
  const Eigen::Vector2d from(150, 120);
  for (const Eigen::Vector2d& motion : {Eigen::Vector2d(20, 0), {-6, 18}, {16, -14}}) {
    const BoardView<Pixel> last(from, 0), present(from + motion, 0);
    for (const double late : {0.0, 0.25, 0.6}) {
      CAPTURE(motion.transpose());
      CAPTURE(late);
      const BoardView<Pixel> depth(from + (1 - late) * motion, 0);
      EdgeMask covering = depth.mask;
      const auto runs = depth.runs();
      const auto added = cover_leading_edge(last.pyramid, present.pyramid, std::span(runs), depth.mask,
                                            motion, wall_stands, {}, covering.view(), workspace);
      REQUIRE(added.has_value());
      // A pixel of the level along two sides may be wrong, and what looks like both.
      const int missing = beyond(present.mask, depth.mask);
      CHECK(beyond(present.mask, covering) <= 0.15 * missing + 90);
      CHECK(beyond(covering, present.mask) <= beyond(depth.mask, present.mask) + 2 * 260);
      if (late == 0.6) CHECK(missing > 900);
    }
  }
}

TEST_CASE("a leading edge stays as it is where nothing is known of the room, or where nothing moved") {
  LeadingEdgeWorkspace workspace;
  const BoardView<> last({150, 120}, 0), present({170, 120}, 0), depth({158, 120}, 0);
  EdgeMask covering = depth.mask;
  const auto runs = depth.runs();
  const auto cover = [&](const Eigen::Vector2d& motion, auto&& room, const LeadingEdgeOptions& options) {
    return cover_leading_edge(last.pyramid, present.pyramid, std::span(runs), depth.mask, motion, room,
                              options, covering.view(), workspace);
  };
  const Eigen::Vector2d motion(20, 0);
  CHECK_FALSE(cover(motion, UnknownRoom{}, {}).has_value());
  CHECK_FALSE(cover({0, 0}, wall_stands, {}).has_value());
  CHECK_FALSE(cover(motion, wall_stands, {.reach = 0}).has_value());
  CHECK_FALSE(cover(motion, wall_stands, {.least = 1000000}).has_value());
  CHECK(beyond(covering, depth.mask) == 0);
  CHECK(cover(motion, wall_stands, {}).value_or(0) > 0);
  CHECK(beyond(covering, depth.mask) > 500);
}

TEST_CASE("the ends of a board that turns go each a way of their own") {
  MaskDelayWorkspace workspace;
  constexpr double kTurn = 0.12;  // [rad]
  const Eigen::Vector2d from(150, 120), to(162, 120);
  const BoardView<> last(from, 0), present(to, kTurn), depth(0.5 * (from + to), kTurn / 2);
  const EdgeMask no_prior;
  // That the images are not taken at once is known, but not by how much.
  const auto missed = [&](const MaskDelayOptions& options) {
    EdgeMask covering = depth.mask;
    cover_delay(last.pyramid, present.pyramid, depth.mask, no_prior, 0.01, options, covering.view(),
                workspace, wall_stands);
    CHECK(beyond(covering, present.mask) <= beyond(depth.mask, present.mask) + 2 * 260);
    return beyond(present.mask, covering);
  };
  const int bare = beyond(present.mask, depth.mask);
  CHECK(bare > 900);
  // Seven degrees in a frame, of which half a piece is 5 pixels: not all can be told.
  CHECK(missed({}) < 0.85 * bare);
  CHECK(missed({.piece = 1}) > 1.1 * missed({}));
}
