// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/geometry/rolling_camera.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <optional>
#include <unsupported/Eigen/AutoDiff>

#include "dynslam/geometry/brown_conrady.hpp"
#include "dynslam/geometry/pinhole.hpp"

using namespace dynslam;

namespace {

template <class S>
PinholeBrownConrady<S> lens() {
  return PinholeBrownConrady<S>(Pinhole<S>(S(517), S(516), S(318), S(255)),
                                BrownConrady<S>(S(0.1), S(-0.2), S(0.001), S(-0.002), S(0)));
}

template <class S>
RollingShutter<S> turning_shutter() {
  Eigen::Matrix<S, 6, 1> motion;
  motion << S(0.012), S(-0.006), S(0.004), S(0.02), S(0.048), S(-0.015);
  return RollingShutter<S>(motion, 480);
}

}  // namespace

TEST_CASE_TEMPLATE("a rolling shutter's camera sees a point where it is when its row is read, and back", S,
                   float, double) {
  using Camera = RollingCamera<PinholeBrownConrady<S>>;
  static_assert(DifferentiableCamera<Camera> && HasPinhole<Camera>);
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  const PinholeBrownConrady<S> camera = lens<S>();
  const RollingShutter<S> shutter = turning_shutter<S>();
  const Camera rolling(camera, shutter);
  CHECK(rolling.moves());
  for (const Vector2& x : {Vector2(S(40), S(30)), Vector2(S(600), S(20)), Vector2(S(330), S(250)),
                           Vector2(S(50), S(460)), Vector2(S(590), S(470))}) {
    CAPTURE(x.transpose());
    const S z = S(1.7);
    const auto p = rolling.unproject(x, z);
    REQUIRE(p);
    CHECK((*rolling.project(*p) - x).norm() < S(0.004));
    CHECK(std::abs(p->z() - rolling.depth_at_middle(x, z)) < S(1e-6));
    const auto ideal = rolling.undistort_pixel(x, z);
    REQUIRE(ideal);
    CHECK((*ideal - *camera.pinhole().project(*p)).norm() < S(1e-3));

    Eigen::Matrix<S, 2, 3> J = Eigen::Matrix<S, 2, 3>::Zero();
    REQUIRE(rolling.project(*p, &J));
    for (int i = 0; i < 3; ++i) {
      const Vector3 step = S(0.01) * Vector3::Unit(i);
      const Vector2 slope = (*rolling.project(*p + step) - *rolling.project(*p - step)) / S(0.02);
      CHECK((J.col(i) - slope).norm() < S(2e-3) * J.norm());
    }
  }
}

TEST_CASE("a rolling camera's derivative is that of what it projects, in a jerk, too") {
  using Dual = Eigen::AutoDiffScalar<Eigen::Vector3d>;
  const PinholeBrownConrady<double> camera = lens<double>();
  const PinholeBrownConrady<Dual> dual_camera = camera.cast<Dual>();
  for (const double jerk : {1.0, 3.0, 8.0}) {  // 2, 6 and 17 rad/s
    Eigen::Matrix<double, 6, 1> motion;
    motion << 0.012, -0.006, 0.004, 0.02, 0.048, -0.015;
    motion *= jerk;
    const RollingShutter<double> shutter(motion, 480);
    const RollingShutter<Dual> dual_shutter(Eigen::Matrix<Dual, 6, 1>(motion.cast<Dual>()), 480);
    const RollingCamera<PinholeBrownConrady<double>> rolling(camera, shutter);
    for (const Eigen::Vector2d& x : {Eigen::Vector2d(40, 30), Eigen::Vector2d(600, 20),
                                     Eigen::Vector2d(330, 239.5), Eigen::Vector2d(50, 460)}) {
      CAPTURE(jerk);
      CAPTURE(x.transpose());
      const auto p = rolling.unproject(x, 1.7);
      REQUIRE(p);
      Eigen::Matrix<double, 2, 3> J;
      const auto again = rolling.project(*p, &J);
      REQUIRE(again);
      CHECK((*again - x).norm() < 1e-3);
      Eigen::Matrix<Dual, 3, 1> p_dual;
      for (int i = 0; i < 3; ++i) p_dual(i) = Dual((*p)(i), 3, i);
      const auto x_dual = dual_shutter.project(dual_camera, p_dual);
      REQUIRE(x_dual);
      for (int i = 0; i < 2; ++i) {
        CHECK(std::abs((*x_dual)(i).value() - x(i)) < 1e-6);
        CHECK((J.row(i).transpose() - (*x_dual)(i).derivatives()).norm() < 1e-4 * J.norm());
      }
    }
  }
}

TEST_CASE_TEMPLATE("it keeps its camera, which may have been a temporary one", S, float, double) {
  using Camera = RollingCamera<PinholeBrownConrady<S>>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  // Fault: it referred to the camera; under the address sanitizer, a use after scope.
  const auto make = [] { return Camera(lens<S>(), turning_shutter<S>()); };
  const Camera rolling = make();
  const PinholeBrownConrady<S> camera = lens<S>();
  const Vector3 p(S(0.3), S(-0.4), S(1.7));
  CHECK(*rolling.project(p) == *Camera(camera, turning_shutter<S>()).project(p));
}

TEST_CASE_TEMPLATE("without motion it is the camera itself, to the bit", S, float, double) {
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  const PinholeBrownConrady<S> camera = lens<S>();
  const RollingCamera<PinholeBrownConrady<S>> global(camera, RollingShutter<S>());
  CHECK_FALSE(global.moves());
  const Vector3 p(S(0.3), S(-0.4), S(1.7));
  Eigen::Matrix<S, 2, 3> J = Eigen::Matrix<S, 2, 3>::Zero(), own = J;
  CHECK(*global.project(p, &J) == *camera.project(p, &own));
  CHECK(J == own);
  CHECK(*global.project(p) == *camera.project(p));
  const Vector2 x(S(100.5), S(80.25));
  CHECK(*global.unproject(x, S(2)) == *camera.unproject(x, S(2)));
  CHECK(*global.undistort_pixel(x, S(2)) == *camera.undistort_pixel(x));
  CHECK(global.pinhole() == camera.pinhole());
}
