// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/local_map.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <bitset>

#include "random.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

Frame frame_that_sees(const std::vector<int>& points, double x) {
  Frame f;
  f.T_c_w = SE3d(SO3d(), Eigen::Vector3d(x, 0, 0));
  f.point = points;
  f.features.resize(points.size());
  f.descriptors.resize(points.size());
  f.dynamic.resize(points.size());
  return f;
}

}  // namespace

TEST_CASE("the distance of descriptors is the number of different bits") {
  test::Rng rng("hamming");
  for (int trial = 0; trial < 200; ++trial) {
    Descriptor a, b;
    int expected = 0;
    for (std::size_t w = 0; w < 4; ++w) {
      a[w] = rng.engine()();
      b[w] = trial == 0 ? ~a[w] : trial == 1 ? a[w] : rng.engine()();
      expected += static_cast<int>(std::bitset<64>(a[w] ^ b[w]).count());
    }
    CHECK(hamming_distance(a, b) == expected);
  }
}

TEST_CASE("merged points leave one, with the observers of both") {
  LocalMap map;
  for (int k = 0; k < 4; ++k) (void)map.add_point({});
  (void)map.add_keyframe(frame_that_sees({0, 1}, 0));
  (void)map.add_keyframe(frame_that_sees({0, 2}, 1));
  (void)map.add_keyframe(frame_that_sees({3, -1}, 2));
  map.merge(2, 1);
  CHECK(map.keyframe(1).frame.point == std::vector<int>{0, 1});
  CHECK(map.point(1).keyframes == std::vector<int>{0, 1});
  CHECK(map.point(2).bad);
  map.merge(1, 0);  // both keyframes see both: each shows it once
  CHECK(map.keyframe(0).frame.point == std::vector<int>{0, -1});
  CHECK(map.keyframe(1).frame.point == std::vector<int>{0, -1});
  CHECK(map.present(2) == 0);
  map.observe(2, 1, 0);
  CHECK(map.point(0).keyframes == std::vector<int>{0, 1, 2});
  map.merge(0, 0);
  CHECK_FALSE(map.point(0).bad);
}

TEST_CASE("a keyframe that tells nothing new goes, and its pose follows its parent") {
  LocalMap map;
  for (int k = 0; k < 20; ++k) (void)map.add_point({});
  std::vector<int> all(20);
  for (int k = 0; k < 20; ++k) all[static_cast<std::size_t>(k)] = k;
  const std::vector<int> first(all.begin(), all.begin() + 10), second(all.begin() + 10, all.end());
  (void)map.add_keyframe(frame_that_sees(first, 0.0));
  (void)map.add_keyframe(frame_that_sees(first, 0.1));  // redundant
  (void)map.add_keyframe(frame_that_sees(all, 0.2));    // alone with two others in the second half
  (void)map.add_keyframe(frame_that_sees(first, 0.3));
  (void)map.add_keyframe(frame_that_sees(all, 0.4));
  (void)map.add_keyframe(frame_that_sees(second, 0.5));
  CHECK(map.cull_keyframes(4, 0.9, 2) == std::vector<int>{1});
  CHECK(map.keyframe(1).culled());
  CHECK(map.keyframe(1).frame.features.empty());
  CHECK(std::find(map.point(0).keyframes.begin(), map.point(0).keyframes.end(), 1) ==
        map.point(0).keyframes.end());
  CHECK(map.pose(1).translation().x() == doctest::Approx(0.1));
  const int parent = map.keyframe(1).parent;
  map.keyframe(parent).frame.T_c_w =
      SE3d(SO3d(), Eigen::Vector3d(0, 1, 0)) * map.keyframe(parent).frame.T_c_w;
  CHECK(map.pose(1).translation().x() == doctest::Approx(0.1));
  CHECK(map.pose(1).translation().y() == doctest::Approx(1.0));
  CHECK(map.cull_keyframes(4, 0.9, 2).empty());
  std::vector<std::pair<int, int>> near;
  map.covisible(4, 1, near);
  CHECK(near.front() == std::pair(20, 2));
  CHECK(std::none_of(near.begin(), near.end(), [](const auto& n) { return n.second == 1; }));
}
