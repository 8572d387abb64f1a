// SPDX-License-Identifier: BSD-3-Clause
// A camera that is tracked, lost and found, of every kind.
#include <doctest/doctest.h>

#include <cstddef>

#include "cameras.hpp"
#include "dynslam/geometry/ideal_pinhole.hpp"
#include "dynslam/track/frame_revision.hpp"
#include "dynslam/track/keyframe_inserter.hpp"
#include "dynslam/track/last_frame.hpp"
#include "dynslam/track/local_map_pose.hpp"
#include "dynslam/track/pose_estimate.hpp"
#include "dynslam/track/pose_search.hpp"
#include "dynslam/track/pose_tracking_options.hpp"
#include "dynslam/track/relocaliser.hpp"
#include "tracked_wall.hpp"

using namespace dynslam;

TEST_CASE_TEMPLATE("every camera is tracked and found again", Camera, DYNSLAM_CONFORMANCE_EACH_CAMERA) {
  using S = typename Camera::ScalarType;
  using Wall = test::TrackedWall<Camera>;
  Wall wall(test::conformance_camera<Camera>());
  wall.start();

  PoseSearch<Camera> search(wall.options, 1);
  const auto tracked = wall.view(2);
  SearchedFrame<S> now;
  wall.see(tracked, now);
  const auto align = [](const SE3<S>&) { return ImageAlignmentResult<S>(); };
  REQUIRE(search.locate(
      wall.evidence(tracked), wall.solver, align, [] {}, now));
  CHECK(wall.error(now.frame.T_c_w, tracked) < S(0.01));
  FrameRevision<Camera> revision(wall.options);
  CHECK_FALSE(revision.revise(wall.map, wall.last, tracked.time.t, now.frame.T_c_w, wall.solver));

  wall.last.lose();

  Relocaliser<Camera> relocaliser(ideal_pinhole(wall.camera), wall.camera, {S(0.004), S(0.008)}, {},
                                  wall.options);
  const auto again = wall.view(3);
  PoseEstimate<S> found;
  wall.see(again, found);
  REQUIRE(relocaliser.locate(wall.evidence(again), wall.places, wall.solver, found));
  CHECK(wall.error(found.frame.T_c_w, again) < S(0.01));
}
