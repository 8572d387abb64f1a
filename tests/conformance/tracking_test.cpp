// SPDX-License-Identifier: BSD-3-Clause
// A camera that is tracked, of every kind.
#include <doctest/doctest.h>

#include "dynslam/track/last_frame.hpp"
#include "dynslam/track/pose_tracking_options.hpp"

using namespace dynslam;

TEST_CASE_TEMPLATE("the motion model is of any scalar", S, float, double) {
  LastFrame<S> last(PoseTrackingOptions<S>(), 0.02, 480);
  CHECK(last.predicted_pose().log().norm() == S(0));
  CHECK_FALSE(last.interval(1));
}
