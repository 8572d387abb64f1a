// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/map/place_verifier.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>

#include "dynslam/geometry/pinhole.hpp"
#include "equidistant_camera.hpp"
#include "feature_cameras.hpp"
#include "round_room.hpp"

using namespace dynslam;

TEST_CASE_TEMPLATE("a place is confirmed by its points, and refused where the depth image looks through them",
                   S, float, double) {
  using Camera = Pinhole<S>;
  test::RoundRoom<Camera> room(Camera(S(525), S(525), S(319.5), S(239.5)));
  room.drift.setZero();
  for (int k = 0; k < 4; ++k) (void)room.add();
  PlaceVerifier<Camera> verifier(room.camera, room.camera, room.noise);
  const FeatureFrame<S> frame = room.map.keyframe(3).frame;
  const Image<float> depth = room.depth(room.truth[3]);
  const auto verify = [&](float scale) {
    Image<float> scaled = depth;
    for (int v = 0; v < scaled.height(); ++v) {
      for (int u = 0; u < scaled.width(); ++u) scaled(u, v) *= scale;
    }
    return verifier.verify(room.map, frame, scaled, 1);
  };
  const auto found = verify(1.0F);
  CAPTURE(static_cast<int>(found.status));
  REQUIRE(found.ok());
  CHECK(found.matches.size() > 100);
  CHECK((found.T_c_w * room.truth[3].inverse()).translation().norm() < S(0.01));
  CHECK(found.covariance.trace() > S(0));
  CHECK(verify(1.5F).status == PlaceStatus::contradicted);
  // People stand in front: no reason to doubt the place, but none to confirm.
  CHECK(verify(0.7F).status == PlaceStatus::contradicted);
  CHECK(verify(std::nanf("")).status == PlaceStatus::contradicted);
  // Depth of another size or scalar is no matter of course, but it works.
  Image<double> half(320, 240, 1.0);
  CHECK(verifier.verify(room.map, frame, half, 1).status == PlaceStatus::contradicted);
}

TEST_CASE_TEMPLATE("what shows another place is refused by the first test that it fails", S, float, double) {
  using Camera = Pinhole<S>;
  test::RoundRoom<Camera> room(Camera(S(525), S(525), S(319.5), S(239.5)));
  for (int k = 0; k < 12; ++k) (void)room.add();
  PlaceVerifier<Camera> verifier(room.camera, room.camera, room.noise);
  const Image<float> depth = room.depth(room.truth[11]);
  CHECK(verifier.verify(room.map, room.map.keyframe(11).frame, depth, 0).status ==
        PlaceStatus::too_few_matches);
  // Right descriptors on wrong places: no pose explains them.
  FeatureFrame<S> scrambled = room.map.keyframe(11).frame;
  std::reverse(scrambled.descriptors.begin(), scrambled.descriptors.end());
  scrambled.grid.build(scrambled.features, 640, 480);
  CHECK_FALSE(verifier.verify(room.map, scrambled, depth, 11).ok());
  FeatureFrame<S> moving = room.map.keyframe(11).frame;
  moving.dynamic.assign(moving.features.size(), 1);
  CHECK(verifier.verify(room.map, moving, depth, 11).status == PlaceStatus::too_few_matches);
}

TEST_CASE_TEMPLATE("the depth image may be that of any camera, such as a fisheye of the test's own", S, float,
                   double) {
  using Camera = Pinhole<S>;
  using Fisheye = test::EquidistantCamera<S>;
  test::RoundRoom<Camera> room(Camera(S(525), S(525), S(319.5), S(239.5)));
  room.drift.setZero();
  for (int k = 0; k < 4; ++k) (void)room.add();
  const Fisheye fisheye(S(300), S(319.5), S(239.5));
  PlaceVerifier<Camera, Fisheye> verifier(room.camera, fisheye, room.noise);
  const FeatureFrame<S> frame = room.map.keyframe(3).frame;
  const auto found = verifier.verify(room.map, frame, room.depth(room.truth[3], fisheye), 1);
  REQUIRE(found.ok());
  CHECK((found.T_c_w * room.truth[3].inverse()).translation().norm() < S(0.01));
  Image<float> farther = room.depth(room.truth[3], fisheye);
  for (int v = 0; v < farther.height(); ++v) {
    for (int u = 0; u < farther.width(); ++u) farther(u, v) *= 1.5F;
  }
  CHECK(verifier.verify(room.map, frame, farther, 1).status == PlaceStatus::contradicted);
}

TEST_CASE_TEMPLATE("features may be in the pixels of any camera, such as a fisheye", Camera,
                   DYNSLAM_FISHEYES) {
  using S = typename Camera::ScalarType;
  test::RoundRoom<Camera> room(test::feature_camera<Camera>());
  room.drift.setZero();
  for (int k = 0; k < 4; ++k) (void)room.add();
  PlaceVerifier<Camera> verifier(room.camera, room.camera, room.noise);
  const FeatureFrame<S> frame = room.map.keyframe(3).frame;
  Image<float> depth = room.depth(room.truth[3]);
  const auto found = verifier.verify(room.map, frame, depth, 1);
  REQUIRE(found.ok());
  CHECK(found.matches.size() > 100);
  CHECK((found.T_c_w * room.truth[3].inverse()).translation().norm() < S(0.01));
  for (int v = 0; v < depth.height(); ++v) {
    for (int u = 0; u < depth.width(); ++u) depth(u, v) *= 1.5F;
  }
  CHECK(verifier.verify(room.map, frame, depth, 1).status == PlaceStatus::contradicted);
}
