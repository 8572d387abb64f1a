// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/dynamics/moved_outlines.hpp"

#include <doctest/doctest.h>

#include "dynslam/dynamics/free_space_history.hpp"
#include "dynslam/dynamics/keypoint_bodies.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/segment/growing_criteria.hpp"

using namespace dynslam;

namespace {

/// A board at 1.5 m before a wall at 3 m, seen by a camera that stands, in a grid of 80 x 60 cells.
template <class S>
struct OutlineScene {
  DepthGrid grid{Pinhole<S>(S(200), S(200), S(159.5), S(119.5)), 320, 240, {.columns = 80}};
  FreeSpaceHistory<S> history;
  Image<float> depth;
  Image<std::uint8_t> smooth, still;
  Image<float> age;
  double t = 0;
  FreeSpaceVerdicts verdicts;
  MovedOutlineOptions options;
  MovedOutlineWorkspace ws;
  float foot = 0;  ///< depth of a desk that touches the lower end of the board; 0: there is none

  OutlineScene() {
    still.resize(grid.width(), grid.height());
    still.fill(kCellStatic);
    age.resize(grid.width(), grid.height());
    age.fill(0);
  }
  /// Looks at the board with its left edge at a column of the image.
  void look(int left) {
    Image<float> image(320, 240, 3.0F);
    for (int v = 60; v < 180; ++v) {
      for (int u = std::max(0, left); u < std::min(320, left + 120); ++u) image(u, v) = 1.5F;
    }
    for (int v = 180; foot > 0 && v < 240; ++v) {
      for (int u = 0; u < 320; ++u) image(u, v) = foot;
    }
    grid.reduce(image, depth, smooth);
    history.check(grid, depth, smooth, t, SE3<S>(), verdicts);
    history.remember(depth, t, SE3<S>(), still, age);
    t += 1 / 30.0;
    watch_outlines(depth, verdicts, RelativeStep<float>{0.03F, 0.01F}, FreeSpaceMargins<float>{}, options,
                   ws);
  }
  /// The surface that holds a cell.
  [[nodiscard]] const SurfaceOutline& at(int u, int v) const {
    REQUIRE(ws.surface(u, v) != 0);
    return ws.surfaces[static_cast<std::size_t>(ws.surface(u, v) - 1)];
  }
  [[nodiscard]] bool moved(int u, int v, int at_rest) const {
    return outline_moved(at(u, v), std::span<const SurfaceOutline>(ws.surfaces), options, at_rest);
  }
};

}  // namespace

TEST_CASE_TEMPLATE("a board that slides in its own plane is found whole by its outline", S, float, double) {
  OutlineScene<S> s;
  for (int k = 0; k < 8; ++k) s.look(60 + 5 * k);
  // Its middle is where it was: the depth alone takes that for a surface at rest.
  CHECK(s.verdicts.verified(35, 30) == 1);
  CHECK(s.at(35, 30).cells > 80);
  CHECK(s.moved(35, 30, 0));
  CHECK_FALSE(s.moved(2, 2, 0));  // the wall
  CHECK(s.at(2, 2).moved == 0);
}

TEST_CASE_TEMPLATE("a board that leaves is found by what it uncovers, and one at rest rests", S, float,
                   double) {
  OutlineScene<S> s;
  for (int k = 0; k < 8; ++k) s.look(220 + 4 * k);  // into the image's rim: its leading edge is not seen
  CHECK(s.moved(70, 30, 0));
  for (int k = 0; k < 12; ++k) s.look(248);
  CHECK(s.at(70, 30).moved == 0);
  CHECK_FALSE(s.moved(70, 30, 0));
  CHECK(s.at(70, 30).still(s.options, 12));
}

TEST_CASE(
    "what stands on the same surface as a mover stays: keypoints at rest outvote a part of an outline") {
  OutlineScene<double> s;
  s.foot = 1.5F;
  for (int k = 0; k < 8; ++k) s.look(60 + 5 * k);
  const SurfaceOutline both = s.at(35, 30);
  CHECK(both.begin == s.at(5, 55).begin);  // one surface with the desk
  CHECK(both.moved_by(0.3));
  CHECK_FALSE(both.moved_by(0.7));
  CHECK(s.moved(35, 30, 0));
  CHECK(s.moved(35, 30, s.options.at_rest));
  CHECK_FALSE(s.moved(35, 30, s.options.at_rest + 1));
}

TEST_CASE_TEMPLATE("what stands before the rest of the view is told from what lies behind", S, float,
                   double) {
  OutlineScene<S> s;
  s.look(100);
  CHECK(s.at(40, 30).in_foreground(s.options));
  CHECK(s.at(40, 30).hidden == 0);
  CHECK_FALSE(s.at(2, 2).in_foreground(s.options));  // the wall
  CHECK(s.at(2, 2).hidden == s.at(40, 30).cells);
  CHECK(s.at(2, 2).cells == 0);
}

TEST_CASE(
    "a surface is a mover by its keypoints where they have moved and the others rest, and many of all are "
    "its") {
  SurfaceOutline s;
  s.cells = 90;
  s.hidden = 10;
  const MovedOutlineOptions options;
  const auto moved = [&](KeypointCount on_it, KeypointCount all) {
    return keypoints_moved(s, on_it, all, options);
  };
  CHECK(moved({100, 5}, {150, 50}));
  CHECK_FALSE(moved({100, 30}, {150, 80}));  // it rests in part
  CHECK_FALSE(moved({100, 5}, {150, 20}));   // nothing rests: the pose is wrong
  CHECK_FALSE(moved({100, 5}, {110, 15}));   // next to nothing is left to tell
  CHECK_FALSE(moved({30, 0}, {150, 120}));   // few of all: the residuals' scale is the others'
  CHECK_FALSE(moved({14, 0}, {29, 15}));
  s.hidden = 50;  // something nearer hides it in part: it may be the room
  CHECK_FALSE(moved({100, 5}, {150, 50}));
}

TEST_CASE("where all outlines have moved a little, the pose is wrong and nobody moves") {
  std::vector<SurfaceOutline> surfaces(2);
  for (SurfaceOutline& s : surfaces) {
    s.cells = 100;
    s.moved = 40;
  }
  const MovedOutlineOptions options;
  const auto moved = [&] {
    return outline_moved(surfaces[0], std::span<const SurfaceOutline>(surfaces), options, 0);
  };
  CHECK_FALSE(moved());
  surfaces[1].moved = 5;
  CHECK(moved());
  surfaces[1].moved = 90;  // surely a mover, of which nobody is surprised
  CHECK(moved());
}
