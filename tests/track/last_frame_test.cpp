// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/track/last_frame.hpp"

#include <doctest/doctest.h>

#include <utility>

using namespace dynslam;

namespace {

/// A camera at constant velocity, tracked at t = 0 s and 0.1 s, whose rows take 20 ms.
template <class S>
struct MovedTwice {
  using Vector6 = typename SE3<S>::Vector6;
  Vector6 step = (Vector6() << S(0.01), S(-0.02), S(0.03), S(0.02), S(0.01), S(-0.03)).finished();
  LastFrame<S> last{PoseTrackingOptions<S>(), 0.02, 480};

  MovedTwice() {
    see(0, SE3<S>());
    see(0.1, SE3<S>::exp(step));
  }
  void see(double t, const SE3<S>& T_c_w) {
    FeatureFrame<S> frame;
    frame.features.resize(1);
    frame.t = t;
    frame.T_c_w = T_c_w;
    last.accept(T_c_w, t);
    last.replace(std::move(frame), {t}, {}, 0, {});
  }
};

}  // namespace

TEST_CASE_TEMPLATE("the next pose is predicted at constant velocity, over a loss, too", S, float, double) {
  MovedTwice<S> camera;
  const auto error = [&](int steps) {
    const SE3<S> expected = SE3<S>::exp(camera.step * static_cast<S>(steps));
    return (camera.last.predicted_pose() * expected.inverse()).log().norm();
  };
  CHECK(error(2) < S(1e-5));
  camera.last.lose();
  CHECK(error(3) < S(1e-5));
  camera.see(0.3, SE3<S>::exp(S(3) * camera.step));
  CHECK(camera.last.lost_frames() == 0);
  CHECK(camera.last.velocity().log().norm() < S(1e-7));  // two frames one after the other are needed
}

TEST_CASE("the motion since the last frame tells of the present one only where that came right before") {
  MovedTwice<double> camera;
  CHECK(camera.last.interval(0.15).value() == doctest::Approx(0.05));
  CHECK_FALSE(camera.last.interval(0.1));
  CHECK_FALSE(camera.last.interval(0.1 + PoseTrackingOptions<double>().longest_motion()));
  camera.last.lose();
  CHECK_FALSE(camera.last.interval(0.15));
  CHECK_FALSE(LastFrame<double>({}, 0, 480).interval(0.15));
}

TEST_CASE_TEMPLATE("a depth image that came later was taken a share of the motion farther on", S, float,
                   double) {
  MovedTwice<S> camera;
  const SE3<S> T_c_last = SE3<S>::exp(camera.step);
  const auto quarter = camera.last.depth_motion({0.2, 0.025}, T_c_last);
  REQUIRE(quarter);
  CHECK((quarter->log() - S(0.25) * camera.step).norm() < S(1e-6));
  CHECK_FALSE(camera.last.depth_motion({0.2, 0}, T_c_last));
  CHECK_FALSE(camera.last.depth_motion({0.2, 0.06}, T_c_last));  // too long for the velocity to hold
  CHECK_FALSE(camera.last.depth_motion({0.5, 0.025}, T_c_last));
}

TEST_CASE_TEMPLATE("rows are read along the motion, that of an accelerating camera beyond it", S, float,
                   double) {
  MovedTwice<S> camera;
  const RollingShutter<S> even = camera.last.shutter(0.2, SE3<S>::exp(camera.step));
  REQUIRE(even.moves());
  CHECK((even.omega() - S(0.2) * camera.step.template tail<3>()).norm() < S(1e-6));
  // Twice as fast: half of what was gained since the middle of the interval is added.
  const RollingShutter<S> faster = camera.last.shutter(0.2, SE3<S>::exp(S(2) * camera.step));
  CHECK((faster.omega() - S(0.2 * 2.25) * camera.step.template tail<3>()).norm() < S(1e-6));
  CHECK_FALSE(camera.last.shutter(0.1, SE3<S>()).moves());
  CHECK_FALSE(LastFrame<S>({}, 0, 480).shutter(0.2, SE3<S>()).moves());
}

TEST_CASE("poses are within reach as far as a hand may have moved, and everywhere in a map that was loaded") {
  MovedTwice<double> camera;
  const SE3<double> here = SE3<double>::exp(camera.step);
  const auto aside = [&](double metres) { return SE3<double>(SO3<double>(), {metres, 0, 0}) * here; };
  CHECK(camera.last.reachable(aside(0.39), 0.2));
  CHECK_FALSE(camera.last.reachable(aside(0.41), 0.2));
  CHECK_FALSE(camera.last.reachable(SE3<double>(SO3<double>::exp({0, 0.9, 0}), {0, 0, 0}) * here, 0.2));
  CHECK(LastFrame<double>({}, 0, 480).reachable(aside(5), 0.2));
}

TEST_CASE("a correction of the map moves the last frame, and not its velocity") {
  MovedTwice<double> camera;
  const SE3<double> D = SE3<double>::exp(0.5 * camera.step);
  const SE3<double> before = camera.last.frame().T_c_w, velocity = camera.last.velocity();
  camera.last.follow(D);
  CHECK((camera.last.frame().T_c_w * (before * D).inverse()).log().norm() < 1e-12);
  CHECK((camera.last.velocity() * velocity.inverse()).log().norm() < 1e-15);
}
