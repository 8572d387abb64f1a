// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/geometry/kannala_brandt.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <type_traits>
#include <unsupported/Eigen/AutoDiff>

#include "dynslam/geometry/ideal_pinhole.hpp"
#include "jacobian.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

// TUM VI, 512 x 512.
const KannalaBrandt<double> kTumVi(190.978, 190.973, 254.932, 256.897,
                                   Eigen::Vector4d(0.0034824, 0.00071503, -0.0020532, 0.00020294));

Eigen::Vector3d at_angle(double theta, double azimuth) {
  return {std::sin(theta) * std::cos(azimuth), std::sin(theta) * std::sin(azimuth), std::cos(theta)};
}

}  // namespace

TEST_CASE_TEMPLATE("a fisheye's unproject inverts project up to 89 degrees", S, float, double) {
  test::Rng rng("kannala brandt");
  const auto camera = kTumVi.cast<S>();
  for (int k = 0; k < 1000; ++k) {
    const double theta = k == 0 ? 0.0 : rng.uniform(0, 89) * std::numbers::pi / 180;
    const Eigen::Matrix<S, 3, 1> p =
        (rng.uniform(0.3, 8) * at_angle(theta, rng.uniform(-3, 3))).template cast<S>();
    const auto x = camera.project(p);
    REQUIRE(x);
    const auto back = camera.unproject(*x, p.z());
    REQUIRE(back);
    // Near 90 degrees a hair of an angle is a long way at a given z: compare directions.
    CHECK(static_cast<double>((back->normalized() - p.normalized()).norm()) <
          (std::is_same_v<S, float> ? 2e-5 : 1e-13));
    CHECK(back->z() == p.z());
  }
}

TEST_CASE("a fisheye's pixel is at the distance of its formula") {
  for (const double theta : {1e-9, 1e-4, 0.003, 0.01, 0.02, 0.3, 1.0, 1.5}) {
    const auto x = kTumVi.project(3.0 * at_angle(theta, 0.7));
    REQUIRE(x);
    const Eigen::Vector4d k = kTumVi.coefficients();
    const double t = theta * theta;
    const double theta_d = theta * (1 + t * (k(0) + t * (k(1) + t * (k(2) + t * k(3)))));
    const Eigen::Vector2d n((x->x() - kTumVi.cx()) / kTumVi.fx(), (x->y() - kTumVi.cy()) / kTumVi.fy());
    CHECK(n.norm() == doctest::Approx(theta_d).epsilon(1e-9).scale(1e-5));
    CHECK(std::atan2(n.y(), n.x()) == doctest::Approx(0.7).epsilon(1e-4));
  }
}

TEST_CASE_TEMPLATE("beyond a right angle a fisheye has neither pixel nor point", S, float, double) {
  const auto camera = kTumVi.cast<S>();
  CHECK(camera.max_angle() <= std::numbers::pi / 2);
  for (const double degrees : {90.0, 91.0, 120.0, 180.0}) {
    CHECK_FALSE(camera.project(at_angle(degrees * std::numbers::pi / 180, 0.3).template cast<S>()));
  }
  const S edge = S(2 * 190.978);  // theta_d = 2 rad
  CHECK_FALSE(camera.unproject({camera.cx() + edge, camera.cy()}, S(1)));
}

TEST_CASE_TEMPLATE("a fisheye's curve that turns back ends the field there", S, float, double) {
  // theta - 0.3 theta^3 turns at theta = 1.054 and would put 1.5 rad beside 0.5 rad.
  const KannalaBrandt<S> camera(S(200), S(200), S(0), S(0),
                                Eigen::Matrix<S, 4, 1>(S(-0.3), S(0), S(0), S(0)));
  CHECK(camera.max_angle() == doctest::Approx(std::sqrt(1 / 0.9)).epsilon(1e-6));
  const auto at = [&](double theta) { return camera.project(at_angle(theta, 0).template cast<S>()); };
  CHECK(at(1.05));
  CHECK_FALSE(at(1.06));
  CHECK_FALSE(at(1.5));
  for (double theta = 0.01; theta < 1.05; theta += 0.01) {
    const auto p = camera.unproject(*at(theta), S(1));
    REQUIRE(p);
    CHECK(std::atan2(static_cast<double>(p->x()), 1.0) ==
          doctest::Approx(theta).epsilon(std::is_same_v<S, float> ? 2e-3 : 1e-8));
  }
  CHECK_FALSE(camera.unproject({S(200 * 0.71), S(0)}, S(1)));  // the largest theta_d is 0.703
}

TEST_CASE("a fisheye's Jacobian equals central differences and dual numbers") {
  test::Rng rng("kannala brandt jacobian");
  using Dual = Eigen::AutoDiffScalar<Eigen::Vector3d>;
  const auto dual_camera = kTumVi.cast<Dual>();
  const auto f = [](const Eigen::Vector3d& q) -> Eigen::Vector2d { return *kTumVi.project(q); };
  KannalaBrandt<double>::Jacobian J;
  for (int k = 0; k < 300; ++k) {
    const double theta = k == 0 ? 0.0 : k < 50 ? rng.uniform(0, 0.02) : rng.uniform(0, 1.5);
    const Eigen::Vector3d p = rng.uniform(0.5, 5) * at_angle(theta, rng.uniform(-3, 3));
    REQUIRE(kTumVi.project(p, &J));
    CHECK(test::relative_error(J, test::central_differences<2, 3>(f, p)) < 1e-6);
    Eigen::Matrix<Dual, 3, 1> dual;
    for (int i = 0; i < 3; ++i) dual(i) = Dual(p(i), 3, i);
    const auto x = dual_camera.project(dual);
    REQUIRE(x);
    for (int i = 0; i < 2; ++i) {
      CHECK((x->coeff(i).derivatives().transpose() - J.row(i)).norm() < 1e-8 * (1 + J.row(i).norm()));
    }
    // The derivative of unproject by the pixel undoes that of project.
    Eigen::Matrix<Dual, 2, 1> pixel(Dual((*kTumVi.project(p))(0), 3, 0), Dual((*kTumVi.project(p))(1), 3, 1));
    const auto q = dual_camera.unproject(pixel, Dual(p.z()));
    REQUIRE(q);
    Eigen::Matrix<double, 3, 2> inverse;
    for (int i = 0; i < 3; ++i) inverse.row(i) = q->coeff(i).derivatives().head<2>();
    CHECK((J * inverse - Eigen::Matrix2d::Identity()).norm() < 1e-7);
  }
}

TEST_CASE("without coefficients a fisheye is equidistant, and its ideal pinhole has its focal length") {
  const KannalaBrandt<double> camera(300, 310, 320, 240, Eigen::Vector4d::Zero());
  const auto x = camera.project(at_angle(0.5, 0));
  REQUIRE(x);
  CHECK(x->x() == doctest::Approx(320 + 300 * 0.5));
  const Pinhole<double> pinhole = ideal_pinhole(camera);
  CHECK(pinhole.fx() == doctest::Approx(300));
  CHECK(pinhole.fy() == doctest::Approx(310));
  CHECK((*to_ideal(camera, pinhole, *x) - *pinhole.project(at_angle(0.5, 0))).norm() < 1e-9);
  CHECK((*from_ideal(camera, pinhole, *pinhole.project(at_angle(0.5, 0))) - *x).norm() < 1e-9);
}

TEST_CASE_TEMPLATE("a fisheye's inverse is right or refused up to the end of the field, whatever its curve",
                   S, float, double) {
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  test::Rng random("inverse of any fisheye");
  const double tolerance = 1e4 * to_double(Eigen::NumTraits<S>::epsilon());  // of the distance or f [px]
  int refused = 0, all = 0;
  for (int lens = 0; lens < 40; ++lens) {
    const Eigen::Matrix<S, 4, 1> k(S(random.uniform(-0.3, 0.3)), S(random.uniform(-0.2, 0.2)),
                                   S(random.uniform(-0.1, 0.1)), S(random.uniform(-0.05, 0.05)));
    const KannalaBrandt<S> camera(S(300), S(300), S(320), S(240), k);
    CAPTURE(k.transpose());
    for (int n = 0; n < 500; ++n) {
      // Half of them within a thousandth of the end.
      const double share = n % 2 == 0 ? random.uniform() : 1 - std::pow(10, random.uniform(-6, -3));
      const double angle = share * camera.max_angle(), around = random.uniform(0, 6.28);
      const Eigen::Matrix<S, 3, 1> p(S(std::sin(angle) * std::cos(around)),
                                     S(std::sin(angle) * std::sin(around)), S(std::cos(angle)));
      const auto x = camera.project(p);
      if (!x) continue;
      ++all;
      const auto back = camera.unproject(*x, p.z());
      // Where the curve turns back its last pixels are rounded to the end of the field.
      if (!back) {
        ++refused;
        CHECK(share > 0.999);
        continue;
      }
      const auto again = camera.project(*back);
      if (!again) continue;  // rounded out of the field
      CHECK(to_double((*again - *x).norm()) <
            tolerance * std::max(1.0, to_double((*x - Vector2(S(320), S(240))).norm()) / 300));
    }
  }
  CHECK(refused < (std::is_same_v<S, float> ? all / 4 : all / 1000));
}
