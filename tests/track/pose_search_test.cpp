// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/track/pose_search.hpp"

#include <doctest/doctest.h>

#include <algorithm>

#include "dynslam/geometry/pinhole.hpp"
#include "tracked_wall.hpp"

using namespace dynslam;

namespace {

template <class S>
struct SearchedWall : test::TrackedWall<Pinhole<S>> {
  using Wall = test::TrackedWall<Pinhole<S>>;
  PoseSearch<Pinhole<S>> search{PoseTrackingOptions<S>(), 1};
  typename Wall::View at = this->view(2);
  SearchedFrame<S> now;
  int aligned = 0, started = 0;
  bool alignment_works = false;

  SearchedWall() : Wall(Pinhole<S>(S(130), S(131), S(79.5), S(59.5))) {
    this->start();
    this->see(at, now);
  }
  bool locate() {
    return search.locate(
        this->evidence(at), this->solver,
        [&](const SE3<S>&) {
          ++aligned;
          ImageAlignmentResult<S> result;
          result.T_image_reference = at.T_c_w * this->last.frame().T_c_w.inverse();
          if (alignment_works) result.status = ImageAlignmentStatus::converged;
          return result;
        },
        [&] { ++started; }, now);
  }
};

}  // namespace

TEST_CASE_TEMPLATE("a frame is located from the last one's points, and proven by the local map", S, float,
                   double) {
  SearchedWall<S> wall;
  REQUIRE(wall.locate());
  CHECK(wall.started == 1);
  CHECK(wall.aligned == 0);
  CHECK(wall.now.inliers > 80);
  CHECK(wall.error(wall.now.frame.T_c_w, wall.at) < S(0.004));
}

TEST_CASE_TEMPLATE("where no points of the last frame are left its grey values are the start", S, float,
                   double) {
  SearchedWall<S> wall;
  auto& point = wall.last.frame().point;
  std::fill(point.begin(), point.end(), -1);
  CHECK_FALSE(wall.locate());
  CHECK(wall.aligned == 1);
  CHECK_FALSE(wall.locate());
  CHECK(wall.aligned == 1);  // once per frame
  wall.now.aligned.reset();
  wall.alignment_works = true;
  REQUIRE(wall.locate());
  CHECK(wall.error(wall.now.frame.T_c_w, wall.at) < S(0.004));
}

TEST_CASE("plain, a frame is not aligned; after some lost frames the motion that was leads nowhere") {
  SearchedWall<double> wall;
  auto& point = wall.last.frame().point;
  const auto matches = point;
  std::fill(point.begin(), point.end(), -1);
  wall.now.plain = true;
  wall.alignment_works = true;
  CHECK_FALSE(wall.locate());
  CHECK(wall.aligned == 0);
  point = matches;
  CHECK(wall.locate());
  for (int k = 0; k < wall.options.coasting_frames; ++k) wall.last.lose();
  CHECK_FALSE(wall.locate());
}
