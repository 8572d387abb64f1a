// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/track/local_map_pose.hpp"

#include <doctest/doctest.h>

#include <cstddef>

#include "dynslam/geometry/pinhole.hpp"
#include "tracked_wall.hpp"

using namespace dynslam;

namespace {

template <class S>
Pinhole<S> wall_camera() {
  return {S(130), S(131), S(79.5), S(59.5)};
}

}  // namespace

TEST_CASE_TEMPLATE("the local map gives the pose from a start that is centimetres off", S, float, double) {
  test::TrackedWall<Pinhole<S>> wall(wall_camera<S>());
  wall.start();
  const auto view = wall.view(2);
  PoseEstimate<S> now;
  wall.see(view, now);
  now.frame.T_c_w = wall.last.frame().T_c_w;  // 3 cm behind
  REQUIRE(wall.solver.refine(wall.evidence(view), wall.options.min_inliers, 0, now));
  CHECK(now.inliers > 80);
  CHECK(wall.error(now.frame.T_c_w, view) < S(0.004));
  CHECK(now.covariance.trace() > S(0));

  // Back to what was, by way of forgetting all.
  const auto found = wall.solver.save(now);
  const std::size_t features = now.frame.features.size();
  wall.solver.restart(wall.evidence(view), now);
  for (const int p : now.frame.point) CHECK(p < 0);
  wall.solver.restore(wall.evidence(view), found, now);
  CHECK(now.frame.features.size() == features);
  CHECK(now.inliers == found.estimate.inliers);
}

TEST_CASE_TEMPLATE("a start that is good to some pixels keeps its matches for the first look", S, float,
                   double) {
  test::TrackedWall<Pinhole<S>> wall(wall_camera<S>());
  wall.start();
  const auto view = wall.view(2);
  const auto refined = [&](S off, int strict_from, PoseEstimate<S>& now) {
    wall.see(view, now);
    now.frame.T_c_w = SE3<S>(SO3<S>(), {off, 0, 0}) * view.T_c_w;
    return wall.solver.refine(wall.evidence(view), wall.options.min_inliers, strict_from, now);
  };
  for (const S off : {S(0.06), S(0.1)}) {  // [m]
    PoseEstimate<S> at_once, second;
    CHECK_FALSE(refined(off, 0, at_once));
    REQUIRE(refined(off, 1, second));
    CHECK(second.inliers > 150);
    CHECK(wall.error(second.frame.T_c_w, view) < S(0.001));
  }
}

TEST_CASE("what patches find on a mask that leaves next to nothing is not used") {
  test::TrackedWall<Pinhole<double>> wall(wall_camera<double>());
  wall.start();
  const auto view = wall.view(2);
  const Image<std::uint8_t> everywhere(wall.kWidth, wall.kHeight, 255);
  auto evidence = wall.evidence(view);
  evidence.left_out = everywhere.view();
  PoseEstimate<double> now;
  wall.solver.begin(evidence, now);
  now.frame.T_c_w = view.T_c_w;
  CHECK_FALSE(wall.solver.prove(evidence, 1, true, now));
  CHECK(now.inliers == 0);
}

TEST_CASE("a start that is nowhere near is no pose") {
  test::TrackedWall<Pinhole<double>> wall(wall_camera<double>());
  wall.start();
  const auto view = wall.view(2);
  PoseEstimate<double> now;
  wall.see(view, now);
  now.frame.T_c_w = SE3<double>(SO3<double>::exp({0, 2, 0}), {0, 0, 0});
  CHECK_FALSE(wall.solver.refine(wall.evidence(view), wall.options.min_inliers, 0, now));
}
