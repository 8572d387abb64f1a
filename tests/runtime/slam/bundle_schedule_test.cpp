// SPDX-License-Identifier: BSD-3-Clause
#include "slam/bundle_schedule.hpp"

#include <doctest/doctest.h>

#include <utility>
#include <vector>

#include "pose_distance.hpp"
#include "random.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

const Pinhole<double> kScheduleCamera(525, 525, 319.5, 239.5);

/// Keyframes beside each other that see the same points, with noise.
LocalMap row_of_keyframes(int count) {
  test::Rng rng("bundle schedule");
  LocalMap map;
  for (int j = 0; j < 100; ++j) {
    LocalMap::PointType point;
    point.p_w = {rng.uniform(-1, 1), rng.uniform(-0.8, 0.8), rng.uniform(2, 3)};
    (void)map.add_point(point);
  }
  for (int k = 0; k < count; ++k) {
    Frame frame;
    frame.T_c_w = SE3d(SO3d(), Eigen::Vector3d(0.02 * k, 0, 0));
    for (int j = 0; j < 100; ++j) {
      const Eigen::Vector3d p_c = frame.T_c_w * map.point(j).p_w;
      const auto x = kScheduleCamera.project(p_c);
      if (!x) continue;
      Feature f;
      f.x = static_cast<float>(x->x() + rng.normal());
      f.y = static_cast<float>(x->y() + rng.normal());
      f.depth = static_cast<float>(p_c.z());
      frame.features.push_back(f);
      frame.point.push_back(j);
      frame.descriptors.emplace_back();
    }
    (void)map.add_keyframe(frame);
  }
  return map;
}

}  // namespace

TEST_CASE("an adjustment is due a fixed number of frames after its keyframe, later after a loop") {
  BundleSchedule bundles(kScheduleCamera, {}, {});
  bundles.request(20, false);
  CHECK_FALSE(bundles.due(23));
  CHECK(bundles.due(24));
  bundles.request(30, true);
  CHECK_FALSE(bundles.due(41));
  CHECK(bundles.due(42));
}

TEST_CASE("what was asked for is used once, and is that of a bundle adjustment") {
  LocalMap map = row_of_keyframes(4), expected = map;
  PlaceIndex places;
  BundleSchedule bundles(kScheduleCamera, {}, {});
  CHECK_FALSE(bundles.apply(map, places));  // nothing was
  bundles.request(0, false);
  bundles.start(map);
  const auto D = bundles.apply(map, places);
  REQUIRE(D);
  CHECK(bundles.adjustments() == 1);
  CHECK_FALSE(bundles.apply(map, places));
  CHECK(bundles.adjustments() == 1);

  LocalBundle bundle(kScheduleCamera, {});
  bundle.start(expected, BundleScheduleOptions().depth_noise);
  CHECK(test::pose_distance(*D, bundle.apply(expected)) == 0);
  for (std::size_t k = 0; k < expected.keyframes().size(); ++k)
    CHECK(test::pose_distance(map.keyframes()[k].frame.T_c_w, expected.keyframes()[k].frame.T_c_w) == 0);
}

TEST_CASE("one that has not started is made up for, and redundant keyframes go from map and places") {
  LocalMap map = row_of_keyframes(9);
  PlaceIndex places;
  for (const LocalMap::KeyframeType& k : map.keyframes()) places.add(k.id, k.frame);
  BundleSchedule bundles(kScheduleCamera, {}, {});
  bundles.request(0, false);
  REQUIRE(bundles.apply(map, places));
  CHECK_FALSE(map.keyframe(0).culled());
  CHECK(map.keyframe(1).culled());  // three others see all of it
  for (int id = 4; id < 9; ++id) CHECK_FALSE(map.keyframe(id).culled());
  std::vector<std::pair<int, int>> votes;
  places.query(map.keyframe(8).frame, votes);
  for (const auto& [count, id] : votes) CHECK_FALSE(map.keyframe(id).culled());
}
