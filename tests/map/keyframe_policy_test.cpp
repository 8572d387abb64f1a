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
