// SPDX-License-Identifier: BSD-3-Clause
#if defined(__GNUC__) && !defined(__clang__)
// g++ 12 takes fright at Eigen's atan2 of dual numbers.
#pragma GCC diagnostic ignored "-Wuse-after-free"
#endif
#include "dynslam/optim/pose_residual.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <concepts>
#include <limits>
#include <unsupported/Eigen/AutoDiff>

#include "dynslam/geometry/brown_conrady.hpp"
#include "dynslam/geometry/kannala_brandt.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/optim/normal_equations.hpp"
#include "dynslam/optim/pose_equations.hpp"
#include "jacobian.hpp"
#include "random.hpp"
#include "test_cameras.hpp"
#include "tum_cameras.hpp"

using namespace dynslam;

namespace {

using Dual = Eigen::AutoDiffScalar<Eigen::Matrix<double, 6, 1>>;

const PinholeBrownConrady<double> kLens(test::kFreiburg3,
                                        BrownConrady<double>(-0.2, 0.05, 0.001, -0.002, 0.01));
const KannalaBrandt<double> kFisheye(330, 332, 320, 240, Eigen::Vector4d(-0.02, 0.005, -0.002, 0.0003));
const test::Panorama<double> kPanorama(260, 320, 240);

SE3d some_pose() {
  Eigen::Matrix<double, 6, 1> xi;
  xi << 0.3, -0.2, 0.1, 0.15, -0.1, 0.2;
  return SE3d::exp(xi);
}

PoseObservation<double> some_observation(test::Rng& rng) {
  PoseObservation<double> o;
  const Eigen::Vector3d p(rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(2, 4));
  o.p_w = some_pose().inverse() * p;
  o.x = Eigen::Vector2d(rng.uniform(0, 640), rng.uniform(0, 480));
  o.depth = rng.chance(0.3) ? 0.0 : p.z() + 0.05 * rng.normal();
  o.inv_sigma_px2 = rng.uniform(0.1, 2);
  o.inv_sigma_z2 = rng.uniform(10, 1000);
  return o;
}

template <class T>
PoseObservation<T> lifted(const PoseObservation<double>& o) {
  return {o.p_w.cast<T>(), o.x.cast<T>(), T(o.depth), T(o.inv_sigma_px2), T(o.inv_sigma_z2)};
}

/// A pose with the derivatives of its left increment.
SE3<Dual> varied(const SE3d& T) {
  Eigen::Matrix<Dual, 6, 1> delta;
  for (int k = 0; k < 6; ++k) delta(k) = Dual(0.0, 6, k);
  return SE3<Dual>::exp(delta) * T.cast<Dual>();
}

template <class Camera>
void check_against_autodiff(const Camera& camera) {
  test::Rng rng("residual autodiff");
  const auto dual_camera = camera.template cast<Dual>();
  PoseEquations<double> sums;
  NormalEquations<double, 6> rows, blocks;
  for (int k = 0; k < 50; ++k) {
    const auto o = some_observation(rng);
    Eigen::Vector3d r;
    Eigen::Matrix<double, 3, 6> J, exact;
    REQUIRE(pose_residual<double>(camera, some_pose(), o, r, &J));
    Eigen::Matrix<Dual, 3, 1> dual;
    REQUIRE(pose_residual<Dual>(dual_camera, varied(some_pose()), lifted<Dual>(o), dual));
    for (int i = 0; i < 3; ++i) {
      CHECK(dual(i).value() == doctest::Approx(r(i)));
      exact.row(i) = dual(i).derivatives().transpose();
    }
    CHECK(test::relative_error(J, exact) < 1e-10);
    const Dual s = observation_chi2<Dual>(dual_camera, varied(some_pose()), lifted<Dual>(o));
    CHECK(s.value() == doctest::Approx(observation_chi2<double>(camera, some_pose(), o)));
    // d (r^T W r) = 2 r^T W J
    Eigen::Vector3d information(o.inv_sigma_px2, o.inv_sigma_px2, measures_depth(o) ? o.inv_sigma_z2 : 0.0);
    const Eigen::Matrix<double, 1, 6> gradient = 2 * r.transpose() * information.asDiagonal() * exact;
    CHECK(test::relative_error(s.derivatives().transpose(), gradient) < 1e-9);
    for (int i = 0; i < 3; ++i) rows.add_row(exact.row(i), r(i), information(i));
    PointLinearisation<Camera> point;
    REQUIRE(point.at(camera, some_pose() * o.p_w, o));
    sums.add(point.terms(camera, information.x(), information.z()));
  }
  sums.store(blocks);
  CHECK(test::relative_error(blocks.hessian(), rows.hessian()) < 1e-10);
  CHECK(test::relative_error(blocks.gradient(), rows.gradient()) < 1e-10);
}

}  // namespace

TEST_CASE(
    "residual, chi-square and normal equations of every camera are those of automatic differentiation") {
  SUBCASE("pinhole") {
    check_against_autodiff(test::kFreiburg3);
  }
  SUBCASE("Brown-Conrady") {
    check_against_autodiff(kLens);
  }
  SUBCASE("Kannala-Brandt") {
    check_against_autodiff(kFisheye);
  }
  SUBCASE("panorama") {
    check_against_autodiff(kPanorama);
  }
}

TEST_CASE_TEMPLATE("the equations for any camera agree with the pinhole's own", S, float, double) {
  test::Rng rng("disguised pinhole");
  const Pinhole<S> camera = test::kFreiburg3.cast<S>();
  const test::DisguisedPinhole<S> disguised(camera);
  PoseEquations<S> fast, general;
  for (int k = 0; k < 50; ++k) {
    const auto o = lifted<S>(some_observation(rng));
    const Eigen::Matrix<S, 3, 1> p = some_pose().cast<S>() * o.p_w;
    const S pixel = static_cast<S>(rng.uniform(0.1, 2)), depth = static_cast<S>(rng.uniform(0, 100));
    PointLinearisation<Pinhole<S>> a;
    PointLinearisation<test::DisguisedPinhole<S>> b;
    REQUIRE(a.at(camera, p, o));
    REQUIRE(b.at(disguised, p, o));
    fast.add(a.terms(camera, pixel, depth));
    general.add(b.terms(disguised, pixel, depth));
  }
  NormalEquations<S, 6> x, y;
  fast.store(x);
  general.store(y);
  const S tolerance = std::same_as<S, float> ? S(1e-5) : S(1e-13);
  CHECK((x.hessian() - y.hessian()).norm() <= tolerance * x.hessian().norm());
  CHECK((x.gradient() - y.gradient()).norm() <= tolerance * x.gradient().norm());
}

TEST_CASE_TEMPLATE("a depth counts where it and its accuracy are given", S, float, double, Dual) {
  const S infinity(std::numeric_limits<double>::infinity()), nan(std::numeric_limits<double>::quiet_NaN());
  CHECK(measures_depth<S>(S(1), S(1)));
  CHECK_FALSE(measures_depth<S>(S(0), S(1)));
  CHECK_FALSE(measures_depth<S>(S(-1), S(1)));
  CHECK_FALSE(measures_depth<S>(nan, S(1)));
  CHECK_FALSE(measures_depth<S>(infinity, S(1)));
  CHECK_FALSE(measures_depth<S>(S(1), S(0)));
}

TEST_CASE("what a camera does not see is infinitely wrong") {
  PoseObservation<double> o;
  o.p_w = Eigen::Vector3d(0.1, 0.2, -2);
  o.x = Eigen::Vector2d(320, 240);
  CHECK(std::isinf(observation_chi2<double>(test::kFreiburg3, SE3d(), o)));
  CHECK(std::isinf(
      observation_chi2<Dual>(test::kFreiburg3.cast<Dual>(), SE3<Dual>(), lifted<Dual>(o)).value()));
  CHECK(std::isfinite(observation_chi2<double>(kPanorama, SE3d(), o)));  // it looks back
}
