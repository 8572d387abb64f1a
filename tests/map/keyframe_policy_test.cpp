// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/map/keyframe_policy.hpp"

#include <doctest/doctest.h>

using namespace dynslam;

TEST_CASE_TEMPLATE("a keyframe is made when points run out, when the camera has moved, and in the end anyway",
                   S, float, double) {
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  const KeyframeOptions<S> options;
  KeyframeEvidence<S> seen{10, 300, 320, SE3<S>()};
  CHECK_FALSE(wants_keyframe(seen, options));
  seen.inliers = 190;  // less than 0.6 of 320
  CHECK(wants_keyframe(seen, options));
  seen.frames = 5;  // but one has just been made
  CHECK_FALSE(wants_keyframe(seen, options));
  seen.inliers = 99;  // no waiting
  CHECK(wants_keyframe(seen, options));
  seen = {10, 300, 320, SE3<S>(SO3<S>(), Vector3(S(0.1), S(0.1), S(0)))};
  CHECK_FALSE(wants_keyframe(seen, options));
  seen.T_c_keyframe = SE3<S>(SO3<S>(), Vector3(S(0.11), S(0.11), S(0)));
  CHECK(wants_keyframe(seen, options));
  seen.T_c_keyframe = SE3<S>(SO3<S>::exp(Vector3(S(0), S(0.21), S(0))), Vector3::Zero().eval());
  CHECK(wants_keyframe(seen, options));
  seen = {30, 300, 320, SE3<S>()};
  CHECK(wants_keyframe(seen, options));
}

TEST_CASE("gaps between keyframes last as long at every rate; near 30 Hz a frame is a frame") {
  CHECK(frames_of_30_hz(6, 6 / 30.0) == 6);
  CHECK(frames_of_30_hz(6, 7 / 30.0) == 6);  // one was dropped
  CHECK(frames_of_30_hz(6, 6 / 25.0) == 6);
  CHECK(frames_of_30_hz(2, 0.2) == 6);   // 10 Hz
  CHECK(frames_of_30_hz(12, 0.2) == 6);  // 60 Hz
  CHECK(frames_of_30_hz(1, 1.0) == 30);  // 1 Hz
  CHECK(frames_of_30_hz(0, 0.0) == 0);
  CHECK(frames_of_30_hz(4, 1e300) == 4);  // no time at all
}
