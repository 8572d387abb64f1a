// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/geometry/pinhole.hpp"

#include <doctest/doctest.h>

#include <unsupported/Eigen/AutoDiff>

#include "jacobian.hpp"
#include "random.hpp"
#include "tum_cameras.hpp"

using namespace dynslam;

namespace {}  // namespace

TEST_CASE_TEMPLATE("unproject inverts project (Eqs 1 and 2)", S, float, double) {
  test::Rng rng("pinhole");
  const auto camera = test::kFreiburg1.cast<S>();
  for (int k = 0; k < 500; ++k) {
    const Eigen::Matrix<S, 2, 1> x(static_cast<S>(rng.uniform(0, 640)), static_cast<S>(rng.uniform(0, 480)));
    const S z = static_cast<S>(rng.uniform(0.3, 8));
    const auto back = camera.project(*camera.unproject(x, z));
    REQUIRE(back);
    CHECK(static_cast<double>((*back - x).norm()) < (std::is_same_v<S, float> ? 1e-3 : 1e-10));
  }
  CHECK(*camera.unproject({S(3), S(4)}, S(2)) == Eigen::Matrix<S, 3, 1>(camera.ray({S(3), S(4)}) * S(2)));
  CHECK_FALSE(camera.project(Eigen::Matrix<S, 3, 1>(S(0), S(0), S(0))));
  CHECK_FALSE(camera.project(Eigen::Matrix<S, 3, 1>(S(0), S(0), S(-1))));
}

TEST_CASE("the projection's Jacobian equals central differences and dual numbers") {
  test::Rng rng("pinhole jacobian");
  using Dual = Eigen::AutoDiffScalar<Eigen::Vector3d>;
  const Pinhole<Dual> dual_camera = test::kFreiburg1.cast<Dual>();
  for (int k = 0; k < 200; ++k) {
    const Eigen::Vector3d p(rng.uniform(-2, 2), rng.uniform(-2, 2), rng.uniform(0.4, 6));
    Pinhole<double>::Jacobian J;
    REQUIRE(test::kFreiburg1.project(p, &J));
    const auto f = [](const Eigen::Vector3d& q) -> Eigen::Vector2d { return *test::kFreiburg1.project(q); };
    const Eigen::Matrix<double, 2, 3> numeric = test::central_differences<2, 3>(f, p);
    CHECK(test::relative_error(J, numeric) < 1e-7);
    Eigen::Matrix<Dual, 3, 1> dual;
    for (int i = 0; i < 3; ++i) dual(i) = Dual(p(i), 3, i);
    const auto x = dual_camera.project(dual);
    REQUIRE(x);
    for (int i = 0; i < 2; ++i) CHECK((x->coeff(i).derivatives().transpose() - J.row(i)).norm() < 1e-9);
  }
  // Negative control: the checker must see one flipped sign.
  Pinhole<double>::Jacobian J;
  const Eigen::Vector3d p(0.5, 0.4, 2);
  (void)test::kFreiburg1.project(p, &J);
  J(0, 2) = -J(0, 2);
  const auto f = [](const Eigen::Vector3d& q) -> Eigen::Vector2d { return *test::kFreiburg1.project(q); };
  CHECK(test::relative_error(J, test::central_differences<2, 3>(f, p)) > 0.01);
}
