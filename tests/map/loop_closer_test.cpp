// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/map/loop_closer.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <numbers>
#include <type_traits>
#include <vector>

#include "dynslam/geometry/pinhole.hpp"
#include "feature_cameras.hpp"
#include "round_room.hpp"

using namespace dynslam;

namespace {

template <class S>
Pinhole<S> pinhole() {
  return Pinhole<S>(S(525), S(525), S(319.5), S(239.5));
}

}  // namespace

TEST_CASE_TEMPLATE("coming around once more takes the drift out of the poses and the doubles out of the map",
                   S, float, double) {
  test::RoundRoom<Pinhole<S>> room(pinhole<S>());
  LoopCloser<Pinhole<S>> closer(room.camera, room.camera, room.noise);
  for (int k = 0; k < 36; ++k) {
    const int id = room.add();
    room.index.add(id, room.map.keyframe(id).frame);
  }
  const int last = room.add();  // the first one's view again
  const S drifted = room.error(0, last);
  const double doubted = room.doubted_sights();
  const SE3<S> before = room.map.pose(last);
  const auto closing = closer.close(room.map, room.index, last, room.depth(room.truth.back()));
  REQUIRE(closing);
  CHECK(drifted > S(0.06));
  CHECK(room.error(closing->seen_again, last) < S(0.2) * drifted);
  CHECK((before * closing->D * room.map.pose(last).inverse()).log().norm() <
        (std::is_same_v<S, float> ? S(1e-5) : S(1e-9)));
  CHECK(closing->seen_again <= 2);
  CHECK(closing->merged > 100);
  CHECK(closer.loops().size() == 1);
  // Points went with the keyframes that see them.
  CHECK(room.doubted_sights() < doubted + 0.02);
  // The ends are neighbours now: the same loop is not found again.
  room.index.add(last, room.map.keyframe(last).frame);
  CHECK_FALSE(closer.close(room.map, room.index, last, room.depth(room.truth.back())));
}

TEST_CASE_TEMPLATE("a loop closes on features in the pixels of any camera, such as a fisheye", Camera,
                   DYNSLAM_FISHEYES) {
  using S = typename Camera::ScalarType;
  test::RoundRoom<Camera> room(test::feature_camera<Camera>());
  LoopCloser<Camera> closer(room.camera, room.camera, room.noise);
  for (int k = 0; k < 36; ++k) {
    const int id = room.add();
    room.index.add(id, room.map.keyframe(id).frame);
  }
  const int last = room.add();
  const S drifted = room.error(0, last);
  const double doubted = room.doubted_sights();
  const auto closing = closer.close(room.map, room.index, last, room.depth(room.truth.back()));
  REQUIRE(closing);
  CHECK(room.error(closing->seen_again, last) < S(0.2) * drifted);
  CHECK(closing->merged > 100);
  CHECK(room.doubted_sights() < doubted + 0.02);
}

TEST_CASE_TEMPLATE("a copy of a place elsewhere in the room is no loop", S, float, double) {
  test::RoundRoom<Pinhole<S>> room(pinhole<S>());
  // What holds on one side holds on the other, too: same pictures, same distances.
  const auto half = room.points.size() / 2;
  const auto turn = SO3<S>::exp(Eigen::Matrix<S, 3, 1>(0, std::numbers::pi_v<S>, 0));
  for (std::size_t j = 0; j < half; ++j) {
    room.points[half + j] = turn * room.points[j];
    room.descriptors[half + j] = room.descriptors[j];
  }
  LoopCloser<Pinhole<S>> closer(room.camera, room.camera, room.noise);
  for (int k = 0; k < 24; ++k) {
    const int id = room.add();
    CHECK_FALSE(closer.close(room.map, room.index, id, room.depth(room.truth.back())));
    room.index.add(id, room.map.keyframe(id).frame);
  }
}

TEST_CASE_TEMPLATE("a loop between keyframes that were culled since holds between their parents", S, float,
                   double) {
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  KeyframeMap<S> map;
  for (int k = 0; k < 4; ++k) {
    FeatureFrame<S> frame;
    frame.T_c_w = SE3<S>(SO3<S>::exp(Vector3(0, S(0.1 * k), 0)), Vector3(S(k), S(0.5), 0));
    (void)map.add_keyframe(frame);
  }
  const auto motion = [&](int i, int j) { return map.pose(j) * map.pose(i).inverse(); };
  PoseGraphEdge<S> edge;
  edge.i = 1;
  edge.j = 3;
  edge.T_j_i = motion(1, 3);
  const SE3<S> beside_first = motion(0, 1), beside_third = motion(2, 3);
  for (const int k : {1, 3}) {
    auto& culled = map.keyframe(k);
    culled.parent = k - 1;
    culled.T_c_parent = k == 1 ? beside_first : beside_third;
  }
  const auto held = edge_of_parents(map, edge);
  CHECK(held.i == 0);
  CHECK(held.j == 2);
  CHECK((held.T_j_i * motion(0, 2).inverse()).log().norm() < S(1e-5));
}
