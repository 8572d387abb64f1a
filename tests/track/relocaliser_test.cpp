// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/track/relocaliser.hpp"

#include <doctest/doctest.h>

#include "dynslam/geometry/pinhole.hpp"
#include "tracked_wall.hpp"

using namespace dynslam;

namespace {

template <class S>
struct LostWall : test::TrackedWall<Pinhole<S>> {
  using Wall = test::TrackedWall<Pinhole<S>>;
  Relocaliser<Pinhole<S>> relocaliser{this->camera, this->camera, DepthNoise<S>{S(0.004), S(0.008)}, {}, {}};
  typename Wall::View at = this->view(3);
  PoseEstimate<S> now;

  LostWall() : Wall(Pinhole<S>(S(130), S(131), S(79.5), S(59.5))) {
    this->start();
    this->last.lose();
    this->see(at, now);
  }
  bool locate() { return relocaliser.locate(this->evidence(at), this->places, this->solver, now); }
};

}  // namespace

TEST_CASE_TEMPLATE("a lost camera is found where a keyframe shows what it sees", S, float, double) {
  LostWall<S> wall;
  REQUIRE(wall.locate());
  CHECK(wall.error(wall.now.frame.T_c_w, wall.at) < S(0.004));
  CHECK(wall.now.covariance.trace() > S(0));
}

TEST_CASE_TEMPLATE("the newest keyframe is tried where the index names none", S, float, double) {
  LostWall<S> wall;
  wall.places = PlaceIndex();
  CHECK(wall.locate());
}

TEST_CASE("a camera is found nowhere by what the map does not show, nor farther than a hand moves") {
  LostWall<double> wall;
  for (Descriptor& look : wall.now.frame.descriptors) {
    for (auto& word : look) word = ~word;
  }
  CHECK_FALSE(wall.locate());
  LostWall<double> far;
  far.last.frame().T_c_w = SE3<double>(SO3<double>(), {2, 0, 0});
  CHECK_FALSE(far.locate());
}
