// SPDX-License-Identifier: BSD-3-Clause
#include "slam/bundle_schedule.hpp"

#include <doctest/doctest.h>

#include <utility>
#include <vector>

#include "pose_distance.hpp"
#include "random.hpp"
#include "row_of_keyframes.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

const Pinhole<double> kScheduleCamera(525, 525, 319.5, 239.5);

LocalMap row_of_keyframes(int count) {
  test::Rng rng("bundle schedule");
  return test::row_of_keyframes(kScheduleCamera, 100, count, 0.02, rng);
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
