// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/dynamics/motion_belief.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/image/image.hpp"

using namespace dynslam;

namespace {

/// A post that stands on a floor, touching it, before a wall; the camera is 1 m above the floor and stands still.
template <class S>
struct Room {
  DepthGrid grid{Pinhole<S>(S(400), S(400), S(319.5), S(239.5)), 640, 480, {}};
  MotionBelief<S> belief;
  Image<float> image{640, 480}, depth;
  Image<std::uint8_t> smooth, mask, post{640, 480};
  double t = 0;

  struct Found {
    double recall = 0, spill = 0;  ///< shares of the post, and of everything else
  };

  /// The next frame with the post's middle at x [m], or without it.
  Found look(double x, bool there = true) {
    for (int v = 0; v < 480; ++v) {
      for (int u = 0; u < 640; ++u) {
        const double rx = (u - 319.5) / 400, ry = (v - 239.5) / 400;
        double z = 4;
        if (ry > 0) z = std::min(z, 1 / ry);
        constexpr double kPost = 2.2;
        const bool on_post = there && kPost < z + 1e-6 && std::abs(kPost * rx - x) < 0.25 && kPost * ry > -0.6;
        image(u, v) = static_cast<float>(on_post ? kPost : z);
        post(u, v) = on_post ? 1 : 0;
      }
    }
    grid.reduce(image, depth, smooth);
    mask.resize(grid.width(), grid.height());
    belief.update(grid, depth, smooth, t, SE3<S>(), {}, std::span<const JudgedMatch<S>>(), mask);
    int on = 0, all = 0, beyond = 0;
    Image<std::uint8_t> full(640, 480);
    for (std::size_t c = 0; c < grid.cells(); ++c) {
      const RecordedPixel p = grid.pixel_of(c);
      const bool is_post = post(p.u, p.v) != 0, found = mask.data()[c] != 0;
      all += is_post ? 1 : 0;
      on += is_post && found ? 1 : 0;
      beyond += !is_post && found ? 1 : 0;
    }
    for (int v = 0; v < 480; ++v) {
      for (int u = 0; u < 640; ++u) full(u, v) = mask.data()[grid.cell(u, v)];
    }
    belief.remember(grid, depth, t, SE3<S>(), full);
    t += 1 / 30.0;
    return {all > 0 ? static_cast<double>(on) / all : 0.0, static_cast<double>(beyond) / static_cast<double>(grid.cells())};
  }
};

}  // namespace

TEST_CASE_TEMPLATE("what walks over a floor is dynamic down to its feet, and the floor is not", S, float, double) {
  Room<S> room;
  for (int k = 0; k < 30; ++k) CHECK(room.look(-1).spill == 0);  // it stands
  typename Room<S>::Found found;
  double x = -1;
  for (int k = 0; k < 40; ++k) {
    x += 1.2 / 30;
    found = room.look(x);
    CHECK(found.spill < 0.006);  // half a cell along its edges
    if (k > 20) CHECK(found.recall > 0.85);
  }
  // It stops, and is static within two seconds; what it uncovers never was dynamic.
  for (int k = 0; k < 60; ++k) found = room.look(x);
  CHECK(found.recall == 0);
  CHECK(found.spill == 0);
  CHECK(room.belief.evidence().belief(80, 60) < -2);
}

TEST_CASE_TEMPLATE("what appears in a room that was seen empty is dynamic at once", S, float, double) {
  Room<S> room;
  for (int k = 0; k < 30; ++k) (void)room.look(0, false);
  const auto found = room.look(0);
  CHECK(found.recall > 0.8);
  CHECK(found.spill < 0.006);
}

TEST_CASE_TEMPLATE("keypoints move what depth cannot tell, and static ones hold it", S, float, double) {
  const auto found_with = [](bool dynamic) {
    Room<S> room;
    for (int k = 0; k < 10; ++k) (void)room.look(0);
    std::vector<JudgedMatch<S>> matches;
    for (int v = 160; v < 360; v += 16) {
      for (int u = 290; u < 350; u += 12) {
        if (room.post(u, v) == 0) continue;
        const Eigen::Matrix<S, 2, 1> x(static_cast<S>(u), static_cast<S>(v));
        matches.push_back({x, x, dynamic ? S(0) : S(1), dynamic});
      }
    }
    for (int k = 0; k < 4; ++k) {
      room.belief.update(room.grid, room.depth, room.smooth, room.t, SE3<S>(), {},
                         std::span<const JudgedMatch<S>>(matches), room.mask);
      room.belief.remember(room.grid, room.depth, room.t, SE3<S>(), Image<std::uint8_t>(640, 480, 255));
      room.t += 1 / 30.0;
    }
    return room.mask(80, 56) != 0;
  };
  CHECK(found_with(true));
  CHECK_FALSE(found_with(false));
}

TEST_CASE("a mask that was rejected is not carried on") {
  Room<double> room;
  for (int k = 0; k < 30; ++k) (void)room.look(0, false);
  REQUIRE(room.look(0).recall > 0.8);
  room.belief.remember(room.grid, room.depth, room.t, SE3<double>(), Image<std::uint8_t>());
  for (std::size_t c = 0; c < room.grid.cells(); ++c) CHECK(room.belief.evidence().belief.data()[c] <= 0);
}
