// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/geometry/rolling_shutter.hpp"

#include <doctest/doctest.h>

#include <cmath>

#include "dynslam/geometry/brown_conrady.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/geometry/se3.hpp"

using namespace dynslam;

namespace {

/// A hand's quick turn while an image is read: 2 rad/s and 0.5 m/s for 24 ms.
template <class S>
Eigen::Matrix<S, 6, 1> quick_turn() {
  Eigen::Matrix<S, 6, 1> motion;
  motion << S(0.012), S(-0.006), S(0.004), S(0.02), S(0.048), S(-0.015);
  return motion;
}

template <class S>
Eigen::Matrix<S, 3, 1> at_row(const Eigen::Matrix<S, 3, 1>& p, S v) {
  return SE3<S>::exp(quick_turn<S>() * (v / S(479) - S(0.5))) * p;
}

}  // namespace

TEST_CASE_TEMPLATE("a rolling shutter's rows have the poses of an even motion", S, float, double) {
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  const RollingShutter<S> shutter(quick_turn<S>(), 480);
  CHECK(shutter.moves());
  const Vector3 p(S(0.6), S(-0.4), S(1.5));
  for (const S v : {S(0), S(100), S(239.5), S(300.25), S(479)}) {
    CAPTURE(v);
    const S tolerance = S(1e-5);  // of second order: (0.027 rad)^3 / 6 of 1.7 m
    CHECK((shutter.to_row(p, v) - at_row<S>(p, v)).norm() < tolerance);
    CHECK((shutter.to_middle(at_row<S>(p, v), v) - p).norm() < tolerance);
  }
  CHECK((shutter.to_row(p, S(239.5)) - p).norm() == S(0));
  CHECK((shutter.to_row(p, S(0)) - p).norm() > S(0.02));
}

TEST_CASE_TEMPLATE("a global shutter, and a camera at rest, leave points where they are", S, float, double) {
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  const Vector3 p(S(0.6), S(-0.4), S(1.5));
  const RollingShutter<S> global;
  CHECK_FALSE(global.moves());
  CHECK(global.to_row(p, S(0)) == p);
  CHECK(global.to_middle(p, S(479)) == p);
  const RollingShutter<S> at_rest(Eigen::Matrix<S, 6, 1>::Zero(), 480);
  CHECK(at_rest.to_row(p, S(0)) == p);
}

TEST_CASE_TEMPLATE("a point is seen in the row that is read when it is there", S, float, double) {
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  const PinholeBrownConrady<S> camera(Pinhole<S>(S(517), S(516), S(318), S(255)),
                                      BrownConrady<S>(S(0.1), S(-0.2), S(0.001), S(-0.002), S(0)));
  const RollingShutter<S> shutter(quick_turn<S>(), 480);
  for (const Vector3& p : {Vector3(S(0.6), S(-0.6), S(1.5)), Vector3(S(-1), S(0.8), S(2)),
                           Vector3(S(0.1), S(0.05), S(0.7)), Vector3(S(0.7), S(0.6), S(1.6))}) {
    CAPTURE(p.transpose());
    const auto x = shutter.project(camera, p);
    REQUIRE(x);
    // By bisection: rows before it are read when the point is below them, rows behind when it is above.
    S low = S(-200), high = S(680);
    for (int i = 0; i < 40; ++i) {
      const S v = (low + high) / S(2);
      const auto seen = camera.project(at_row<S>(p, v));
      REQUIRE(seen);
      (seen->y() > v ? low : high) = v;
    }
    const auto truth = camera.project(at_row<S>(p, low));
    REQUIRE(truth);
    CHECK((*x - *truth).norm() < S(0.02));
    CHECK((*x - *camera.project(p)).norm() > S(0.3));
  }
  CHECK_FALSE(shutter.project(camera, Vector3(S(0), S(0), S(-1))));
  CHECK(*RollingShutter<S>().project(camera, Vector3(S(0.1), S(0.2), S(1))) ==
        *camera.project(Vector3(S(0.1), S(0.2), S(1))));
}
