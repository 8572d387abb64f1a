// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/geometry/se3.hpp"

#include <doctest/doctest.h>

#include <unsupported/Eigen/AutoDiff>
#include <unsupported/Eigen/MatrixFunctions>

#include <numbers>

#include "jacobian.hpp"
#include "pose_distance.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

template <class S>
constexpr double kTolerance = std::is_same_v<S, float> ? 2e-5 : 1e-12;

Eigen::Vector3d random_vector(test::Rng& rng, double size) {
  return Eigen::Vector3d(rng.normal(), rng.normal(), rng.normal()).normalized() * size;
}

template <class S>
SE3<S> random_pose(test::Rng& rng) {
  Eigen::Matrix<double, 6, 1> xi;
  xi << random_vector(rng, rng.uniform(0, 3)), random_vector(rng, rng.uniform(0, 3.1));
  return SE3<S>::exp(xi.cast<S>());
}

}  // namespace

TEST_CASE_TEMPLATE("SE(3) is a group", S, float, double) {
  test::Rng rng("group axioms");
  for (int k = 0; k < 200; ++k) {
    const auto a = random_pose<S>(rng), b = random_pose<S>(rng), c = random_pose<S>(rng);
    const Eigen::Matrix<S, 3, 1> p = random_vector(rng, 2).cast<S>();
    CHECK(test::pose_distance((a * b) * c, a * (b * c)) < 20 * kTolerance<S>);
    CHECK(test::pose_distance(a * a.inverse(), SE3<S>()) < 20 * kTolerance<S>);
    CHECK(static_cast<double>(((a * b) * p - a * (b * p)).norm()) < 40 * kTolerance<S>);
    CHECK(test::pose_distance(SE3<S>(a.so3(), a.translation()), a) == 0.0);
  }
}

TEST_CASE("exp equals the matrix exponential") {
  test::Rng rng("matrix exponential");
  for (int k = 0; k < 100; ++k) {
    Eigen::Matrix<double, 6, 1> xi;
    xi << random_vector(rng, 1.5), random_vector(rng, rng.uniform(1e-9, 3.1));
    Eigen::Matrix4d generator = Eigen::Matrix4d::Zero();
    generator.topLeftCorner<3, 3>() = SO3d::hat(xi.tail<3>());
    generator.topRightCorner<3, 1>() = xi.head<3>();
    const Eigen::Matrix4d expected = generator.exp();
    CHECK((SE3d::exp(xi).matrix() - expected).norm() < 1e-12);
  }
}

TEST_CASE_TEMPLATE("log inverts exp at zero, small, ordinary and nearly straight angles", S, float, double) {
  test::Rng rng("exp log");
  for (const double angle :
       {0.0, 1e-12, 1e-8, 1e-5, 1e-3, 0.5, 2.0, 3.0, std::numbers::pi - 1e-3, std::numbers::pi - 1e-6}) {
    for (int k = 0; k < 20; ++k) {
      Eigen::Matrix<double, 6, 1> xi;
      xi << random_vector(rng, 1.0), random_vector(rng, angle);
      CAPTURE(angle);
      const Eigen::Matrix<double, 6, 1> back = SE3<S>::exp(xi.cast<S>()).log().template cast<double>();
      const double tolerance = std::is_same_v<S, float> ? 1e-3 : 1e-8;
      // At pi the axis may flip: compare the motions then.
      if (angle < 3.1) {
        CHECK((back - xi).norm() < tolerance);
      } else {
        CHECK(test::pose_distance(SE3d::exp(back), SE3d::exp(xi)) < tolerance);
      }
    }
  }
}

TEST_CASE("the adjoint moves an increment to the other side") {
  test::Rng rng("adjoint");
  for (int k = 0; k < 100; ++k) {
    const auto T = random_pose<double>(rng);
    Eigen::Matrix<double, 6, 1> xi;
    xi << random_vector(rng, 0.5), random_vector(rng, 0.5);
    CHECK(test::pose_distance(SE3d::exp(T.adjoint() * xi), T * SE3d::exp(xi) * T.inverse()) < 1e-11);
  }
}

TEST_CASE("the left Jacobian is the derivative of exp, and its inverse the inverse") {
  test::Rng rng("left jacobian");
  for (const double angle : {1e-9, 1e-4, 0.009, 0.011, 1.0, 3.0}) {
    const Eigen::Vector3d w = random_vector(rng, angle);
    const auto f = [&](const Eigen::Vector3d& d) -> Eigen::Vector3d {
      return (SO3d::exp(w + d) * SO3d::exp(w).inverse()).log();
    };
    const Eigen::Matrix3d numeric = test::central_differences<3, 3>(f, Eigen::Vector3d::Zero().eval());
    CAPTURE(angle);
    CHECK(test::relative_error(SO3d::left_jacobian(w), numeric) < 1e-8);
    CHECK((SO3d::left_jacobian(w) * SO3d::left_jacobian_inverse(w) - Eigen::Matrix3d::Identity()).norm() <
          1e-10);
    // Negative control: the right Jacobian, a sign away, must not pass.
    if (angle > 0.1) CHECK(test::relative_error(SO3d::left_jacobian(-w), numeric) > 1e-3);
  }
}

TEST_CASE("the inverse left Jacobian of SE(3) is the derivative of log") {
  test::Rng rng("se3 left jacobian");
  for (const double angle : {0.0, 1e-5, 0.05, 0.099, 0.101, 1.0, 3.0}) {
    SE3d::Vector6 xi;
    xi << random_vector(rng, 0.7), random_vector(rng, angle);
    const auto f = [&](const SE3d::Vector6& d) -> SE3d::Vector6 {
      return (SE3d::exp(d) * SE3d::exp(xi)).log();
    };
    const SE3d::Matrix6 numeric = test::central_differences<6, 6>(f, SE3d::Vector6::Zero().eval());
    CAPTURE(angle);
    CHECK(test::relative_error(SE3d::left_jacobian_inverse(xi), numeric) < 1e-7);
    if (angle > 0.04) CHECK(test::relative_error(SE3d::left_jacobian_inverse(-xi), numeric) > 1e-3);
  }
}

TEST_CASE("exp is differentiable at zero with dual numbers") {
  using Dual = Eigen::AutoDiffScalar<Eigen::Matrix<double, 6, 1>>;
  Eigen::Matrix<Dual, 6, 1> xi;
  for (int i = 0; i < 6; ++i) xi(i) = Dual(0.0, 6, i);
  const Eigen::Matrix<Dual, 3, 1> p(Dual(0.3), Dual(-0.4), Dual(2.0));
  const Eigen::Matrix<Dual, 3, 1> q = SE3<Dual>::exp(xi) * p;
  Eigen::Matrix<double, 3, 6> J, expected;
  for (int i = 0; i < 3; ++i) J.row(i) = q(i).derivatives().transpose();
  expected << Eigen::Matrix3d::Identity(), -SO3d::hat(Eigen::Vector3d(0.3, -0.4, 2.0));
  CHECK((J - expected).norm() < 1e-12);
}
