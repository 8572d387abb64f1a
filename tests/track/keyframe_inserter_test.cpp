// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/track/keyframe_inserter.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cstddef>
#include <vector>

#include "dynslam/geometry/pinhole.hpp"
#include "tracked_wall.hpp"

using namespace dynslam;

namespace {

template <class S>
struct KeptWall : test::TrackedWall<Pinhole<S>> {
  using Wall = test::TrackedWall<Pinhole<S>>;
  using Inserter = KeyframeInserter<Pinhole<S>>;
  int asked = 0;  // which features may make points

  KeptWall() : Wall(Pinhole<S>(S(130), S(131), S(79.5), S(59.5))) {}
  KeyframeInsertion<S> insert(Inserter& into, FeatureFrame<S>& frame, int k) {
    const auto at = this->view(k);
    const auto trust = [&](auto& maker, const FeatureFrame<S>& of) {
      ++asked;
      maker.trust_all(of);
    };
    return into.insert(this->map, this->places, at.pyramid, at.depth, 77, trust, frame);
  }
  FeatureFrame<S> frame(int k) {
    PoseEstimate<S> now;
    const auto at = this->view(k);
    this->see(at, now);
    now.frame.T_c_w = at.T_c_w;
    return now.frame;
  }
};

int with_point(const std::vector<int>& point) {
  return static_cast<int>(std::count_if(point.begin(), point.end(), [](int p) { return p >= 0; }));
}

}  // namespace

TEST_CASE_TEMPLATE("the first keyframe makes points of what a mask suspects, too, and does not count them", S,
                   float, double) {
  for (const bool all : {true, false}) {
    KeptWall<S> wall;
    KeyframeInserterOptions<S> options;
    options.first_points_of_all = all;
    typename KeptWall<S>::Inserter inserter(wall.camera, wall.camera, wall.kWidth, wall.kHeight, options);
    FeatureFrame<S> first = wall.frame(0);
    const std::size_t half = first.features.size() / 2;
    std::fill_n(first.dynamic.begin(), half, std::uint8_t(1));
    const auto inserted = wall.insert(inserter, first, 0);
    CHECK(inserted.keyframe == 0);
    CHECK_FALSE(inserted.loop);
    CHECK(wall.asked == 0);
    const int points = static_cast<int>(wall.map.points().size());
    CHECK(points == with_point(first.point));
    CHECK(inserter.tracked() == (all ? points - static_cast<int>(half) : points));
    CHECK(std::count(first.dynamic.begin(), first.dynamic.end(), 1) == static_cast<std::ptrdiff_t>(half));
  }
}

TEST_CASE(
    "a frame that a keyframe shows already is seen again, another makes points and is found by its place") {
  KeptWall<double> wall;
  KeyframeInserterOptions<double> options;
  options.coverage.min_matches = 1;
  KeptWall<double>::Inserter inserter(wall.camera, wall.camera, wall.kWidth, wall.kHeight, options);
  FeatureFrame<double> first = wall.frame(0);
  (void)wall.insert(inserter, first, 0);
  FeatureFrame<double> again = first;
  again.index = 9;
  CHECK_FALSE(wall.insert(inserter, again, 0).keyframe);
  CHECK(wall.map.newest() == 1);
  CHECK(wall.map.keyframe(1).culled());
  CHECK(inserter.tracked() == 77);

  FeatureFrame<double> other = wall.frame(4);  // without a match
  const auto points = wall.map.points().size();
  CHECK(wall.insert(inserter, other, 4).keyframe == 2);
  CHECK(wall.asked == 1);
  CHECK(wall.map.points().size() > points);
  std::vector<std::pair<int, int>> votes;
  wall.places.query(other, votes);
  CHECK(std::any_of(votes.begin(), votes.end(), [](const auto& vote) { return vote.second == 2; }));
}

TEST_CASE("a frame is wanted by the frames and the motion since the one that was kept last") {
  KeptWall<double> wall;
  KeyframeInserterOptions<double> options;
  options.policy.urgent = 10;
  KeptWall<double>::Inserter inserter(wall.camera, wall.camera, wall.kWidth, wall.kHeight, options);
  FeatureFrame<double> first = wall.frame(0);
  (void)wall.insert(inserter, first, 0);
  const auto wants = [&](std::size_t index, int inliers, double metres) {
    FeatureFrame<double> frame = first;
    frame.index = index;
    frame.t = first.t + static_cast<double>(index) / 30;
    frame.T_c_w = SE3<double>(SO3<double>(), {metres, 0, 0}) * first.T_c_w;
    return inserter.wants(wall.map, frame, inliers);
  };
  CHECK(wants(2, 9, 0));
  CHECK_FALSE(wants(2, 200, 0.5));
  CHECK(wants(8, 200, 0.5));
  CHECK_FALSE(wants(8, 200, 0.01));
  CHECK(wants(31, 200, 0.01));
}

TEST_CASE("bad points are freed once they are many, and the frame's matches keep their points") {
  KeptWall<double> wall;
  KeyframeInserterOptions<double> options;
  options.bad_points = 10;
  KeptWall<double>::Inserter inserter(wall.camera, wall.camera, wall.kWidth, wall.kHeight, options);
  FeatureFrame<double> first = wall.frame(0);
  (void)wall.insert(inserter, first, 0);
  const auto points = wall.map.points().size();
  for (std::size_t p = 0; p < points - 20; ++p) wall.map.points()[p].bad = true;
  FeatureFrame<double> second = first;
  second.index = 9;
  const Eigen::Vector3d kept = wall.map.points().back().p_w;
  (void)wall.insert(inserter, second, 0);
  CHECK(with_point(second.point) >= 20);
  const int last = *std::find_if(second.point.rbegin(), second.point.rend(), [](int p) { return p >= 0; });
  CHECK((wall.map.point(last).p_w - kept).norm() < 1e-12);
}
