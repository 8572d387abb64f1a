// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/dynamics/moved_outlines.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <vector>

#include "dynslam/dynamics/free_space_history.hpp"
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
  Image<std::uint8_t> smooth;
  Image<float> still;  ///< belief in a static cell
  double t = 0;
  MotionEvidence evidence;
  MovedOutlineOptions options;
  MovedOutlineWorkspace ws;
  OutlineScene() {
    still.resize(grid.width(), grid.height());
    still.fill(-4);
  }
  /// Looks at the board with its left edge at a column of the image.
  void look(int left) {
    Image<float> image(320, 240, 3.0F);
    for (int v = 60; v < 180; ++v) {
      for (int u = std::max(0, left); u < std::min(320, left + 120); ++u) image(u, v) = 1.5F;
    }
    grid.reduce(image, depth, smooth);
    history.check(grid, depth, smooth, t, SE3<S>(), evidence);
    history.remember(depth, t, SE3<S>(), still);
    t += 1 / 30.0;
    const Image<int> no_plane(depth.width(), depth.height(), 0);
    watch_outlines(depth, evidence, RelativeStep<float>{0.03F, 0.01F}, no_plane, FreeSpaceMargins<float>{}, options, ws);
  }
  /// The surface that holds a cell.
  [[nodiscard]] const SurfaceOutline& at(int u, int v) const {
    REQUIRE(ws.surface(u, v) != 0);
    return ws.surfaces[static_cast<std::size_t>(ws.surface(u, v) - 1)];
  }
  /// What the outline of the surface that holds a cell says of it.
  [[nodiscard]] float evidence_at(int u, int v) const {
    const SurfaceOutline& one = at(u, v);
    MovedShare others;  // the wall or the board: there is one beside
    for (const SurfaceOutline& o : ws.surfaces) {
      if (&o != &one) others = {others.all + o.cells, others.moved + o.moved};
    }
    const SurfaceEvidenceOptions weights;
    return surface_evidence({one.cells, one.moved}, others.share(), weights.outline, weights);
  }
};

}  // namespace

TEST_CASE_TEMPLATE("a board that slides in its own plane is found whole by its outline", S, float, double) {
  OutlineScene<S> s;
  for (int k = 0; k < 8; ++k) s.look(60 + 5 * k);
  // Its middle is where it was: the depth alone takes that for a surface at rest.
  CHECK(s.evidence.rested(35, 30) == 1);
  CHECK(s.at(35, 30).cells > 80);
  CHECK(s.evidence_at(35, 30) > 1);
  CHECK(s.evidence_at(2, 2) <= 0);  // the wall
  CHECK(s.at(2, 2).moved == 0);
}

TEST_CASE_TEMPLATE("a board that leaves is found by what it uncovers, and one at rest rests", S, float,
                   double) {
  OutlineScene<S> s;
  for (int k = 0; k < 8; ++k) s.look(220 + 4 * k);  // into the image's rim: its leading edge is not seen
  CHECK(s.evidence_at(70, 30) > 0);
  for (int k = 0; k < 12; ++k) s.look(248);
  CHECK(s.at(70, 30).moved == 0);
  CHECK(s.evidence_at(70, 30) < 0);
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

TEST_CASE("a surface moves by as much as more of it has moved than of the others") {
  const SurfaceEvidenceOptions o;
  CHECK(surface_evidence({100, 95}, 0.1, o.keypoints, o) == doctest::Approx(o.most));
  CHECK(surface_evidence({100, 5}, 0.1, o.keypoints, o) == doctest::Approx(-o.most_rest));
  CHECK(surface_evidence({100, 95}, 0.96, o.keypoints, o) < 0);  // all has moved: the pose is wrong
  CHECK(surface_evidence({100, 60}, 0.1, o.keypoints, o) > 0);
  CHECK(surface_evidence({100, 34}, 0.1, o.keypoints, o) < 0);
  CHECK(surface_evidence({o.keypoints - 1, o.keypoints - 1}, 0, o.keypoints, o) == 0);  // too few to tell
  CHECK(surface_evidence({100, 100}, 0, o.keypoints, o) > 0);
}

TEST_CASE("the static share is not raised by a second person, but by a wrong pose") {
  const auto others = [](const std::vector<MovedShare>& surfaces, std::size_t one) {
    std::vector<std::size_t> by_share;
    sort_by_share(surfaces, by_share);
    return share_of_others(surfaces, by_share, one);
  };
  const std::vector<MovedShare> two_people{{200, 10}, {80, 40}, {90, 60}, {40, 1}};
  CHECK(others(two_people, 1) == doctest::Approx(0.05));  // the mean of the others is 0.22
  CHECK(others(two_people, 2) == doctest::Approx(0.05));
  CHECK(others({{200, 150}, {80, 60}, {40, 1}}, 1) == doctest::Approx(0.75));
  CHECK(others({{}, {80, 60}}, 1) == 0);  // alone
}
