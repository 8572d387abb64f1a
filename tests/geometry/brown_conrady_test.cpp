// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/geometry/brown_conrady.hpp"

#include <doctest/doctest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <unsupported/Eigen/AutoDiff>
#include <vector>

#include "jacobian.hpp"
#include "random.hpp"
#include "tum_cameras.hpp"

using namespace dynslam;

namespace {
const BrownConrady<double> kFr1Lens(0.262383, -0.953104, -0.005358, 0.002628, 1.163314);
const PinholeBrownConrady<double> kFr1Camera(test::kFreiburg1, kFr1Lens);
}  // namespace

TEST_CASE_TEMPLATE("fr1's distortion is inverted over the whole image", S, float, double) {
  const PinholeBrownConrady<S> camera(test::kFreiburg1.cast<S>(), kFr1Lens.cast<S>());
  int pixels = 0;
  for (int v = 0; v < 480; v += 4) {
    for (int u = 0; u < 640; u += 4) {
      const Eigen::Matrix<S, 2, 1> x{S(u), S(v)};
      const auto ideal = camera.undistort_pixel(x);
      REQUIRE(ideal);
      CHECK(static_cast<double>((*camera.distort_pixel(*ideal) - x).norm()) <
            (std::is_same_v<S, float> ? 5e-3 : 1e-9));
      ++pixels;
    }
  }
  CHECK(pixels == 120 * 160);
}

TEST_CASE("the distortion's Jacobian equals central differences") {
  test::Rng rng("distortion jacobian");
  for (int k = 0; k < 200; ++k) {
    const Eigen::Vector2d n(rng.uniform(-0.6, 0.6), rng.uniform(-0.5, 0.5));
    BrownConrady<double>::Matrix2 J = BrownConrady<double>::Matrix2::Zero();
    REQUIRE(kFr1Lens.distort(n, &J));
    const auto f = [](const Eigen::Vector2d& m) -> Eigen::Vector2d { return *kFr1Lens.distort(m); };
    CHECK(test::relative_error(J, test::central_differences<2, 2>(f, n)) < 1e-8);
  }
}

TEST_CASE("a point far outside the lens' field has no inverse instead of a wrong one") {
  const BrownConrady<double> folding(-0.5, 0, 0, 0, 0);  // r (1 - r^2 / 2) never exceeds 0.55
  CHECK_FALSE(folding.undistort(Eigen::Vector2d(0.9, 0.0)));
  CHECK(folding.undistort(Eigen::Vector2d(0.3, 0.1)));
}

TEST_CASE_TEMPLATE(
    "what is beyond the fold of a lens has no pixel, and no pixel has a ray from there (k1 = -0.5)", S, float,
    double) {
  const Pinhole<S> pinhole(S(500), S(500), S(320), S(240));
  const PinholeBrownConrady<S> camera(pinhole, BrownConrady<S>(S(-0.5), S(0), S(0), S(0), S(0)));
  CHECK(camera.distortion().valid_radius() == doctest::Approx(std::sqrt(2.0 / 3)).epsilon(1e-6));
  // x / z = 1.5 leads to 1.5 (1 - 0.5 2.25) = -0.19, in the middle of the image.
  CHECK_FALSE(camera.project({S(1.5), S(0), S(1)}));
  CHECK_FALSE(camera.distort_pixel({S(320 + 500 * 1.5), S(240)}));
  CHECK(camera.project({S(0.8), S(0), S(1)}));
  CHECK_FALSE(camera.project({S(0.83), S(0), S(1)}));
  CHECK_FALSE(camera.unproject({S(320 + 500 * 0.56), S(240)}, S(1)));  // the lens ends at 0.544
  for (double n = 0.01; n < 0.81; n += 0.01) {  // up to the fold the inverse is the near one
    const auto x = camera.project({S(n * 0.6), S(n * 0.8), S(1)});
    REQUIRE(x);
    const auto p = camera.unproject(*x, S(1));
    REQUIRE(p);
    CHECK(static_cast<double>((*p - Eigen::Matrix<S, 3, 1>(S(n * 0.6), S(n * 0.8), S(1))).norm()) <
          (std::is_same_v<S, float> ? 3e-4 : 1e-9));
  }
}

TEST_CASE("an inverse on the far side of a fold is refused for the one in the field, with tangential terms") {
  test::Rng rng("folds");
  int folds = 0, solved = 0, near_edge = 0;
  for (int k = 0; k < 3000; ++k) {
    const BrownConrady<double> lens(rng.uniform(-0.6, 0.3), rng.uniform(-0.5, 0.5), rng.uniform(-0.01, 0.01),
                                    rng.uniform(-0.01, 0.01), rng.uniform(-0.5, 0.5));
    const double edge = std::min(1.2, lens.valid_radius());
    folds += lens.valid_radius() < 1.2 ? 1 : 0;
    const double r = edge * std::sqrt(rng.uniform()), a = rng.uniform(-3.2, 3.2);
    const Eigen::Vector2d n(r * std::cos(a), r * std::sin(a));
    const auto d = lens.distort(n);
    if (!d) {  // folded by p1, p2 just inside the radius
      ++near_edge;
      continue;
    }
    const auto back = lens.undistort(*d);
    if (back && (*back - n).norm() < 1e-6) ++solved;
    if (back) CHECK(back->norm() < lens.valid_radius());
  }
  CHECK(folds > 1000);
  CHECK(near_edge < 300);
  CHECK(solved > 0.99 * (3000 - near_edge));
}

TEST_CASE("the derivative by k1 at 0 is r^2 f x / z, not nothing") {
  using Dual = Eigen::AutoDiffScalar<Eigen::Matrix<double, 1, 1>>;
  const Pinhole<Dual> pinhole(Dual(500), Dual(500), Dual(320), Dual(240));
  const BrownConrady<Dual> lens(Dual(0.0, 1, 0), Dual(0), Dual(0), Dual(0), Dual(0));
  const PinholeBrownConrady<Dual> camera(pinhole, lens);
  const auto x = camera.project({Dual(0.5), Dual(0), Dual(1)});
  REQUIRE(x);
  CHECK(x->x().value() == doctest::Approx(570));
  CHECK(x->x().derivatives()(0) == doctest::Approx(62.5));
  // The way back: the ray of the recorded pixel turns inwards.
  const auto ideal = camera.undistort_pixel({Dual(570), Dual(240)});
  REQUIRE(ideal);
  CHECK(ideal->x().derivatives()(0) == doctest::Approx(-62.5));
}

TEST_CASE("with k4, k5 and k6 the lens ends at the pole of the fraction, or where it turns back before") {
  // r / (1 - 0.5 r^2): nothing turns back before the pole at r^2 = 2.
  const BrownConrady<double> pole(0, 0, 0, 0, 0, -0.5, 0, 0);
  CHECK(pole.is_rational());
  CHECK_FALSE(pole.is_identity());
  CHECK(pole.valid_radius() == doctest::Approx(std::sqrt(2.0)));
  CHECK_FALSE(pole.distort({1.5, 0}));
  // r / (1 + r^2) has its maximum 0.5 at r = 1.
  const BrownConrady<double> turns(0, 0, 0, 0, 0, 1, 0, 0);
  CHECK(turns.valid_radius() == doctest::Approx(1));
  CHECK_FALSE(turns.distort({1.01, 0}));
  CHECK_FALSE(turns.undistort({0.51, 0}));
  REQUIRE(turns.undistort({0.4, 0}));
  CHECK(turns.undistort({0.4, 0})->x() == doctest::Approx(0.5));  // not 2, which leads there, too
  // Equal polynomials cancel: no distortion, wherever the denominator is not 0.
  const BrownConrady<double> none(0.3, 0.2, 0, 0, 0.1, 0.3, 0.2, 0.1);
  REQUIRE(none.distort({0.7, -0.4}));
  CHECK((*none.distort({0.7, -0.4}) - Eigen::Vector2d(0.7, -0.4)).norm() < 1e-15);
}

TEST_CASE("eight coefficients: Jacobian, inverse and dual numbers") {
  using Dual = Eigen::AutoDiffScalar<Eigen::Vector2d>;
  test::Rng rng("rational lens");
  int inverted = 0;
  for (int k = 0; k < 2000; ++k) {
    const auto c = [&](double most) { return rng.uniform(-most, most); };
    const BrownConrady<double> lens(c(0.5), c(0.5), c(0.005), c(0.005), c(0.3), c(0.5), c(0.5), c(0.3));
    const double r = std::min(1.2, 0.95 * lens.valid_radius()) * std::sqrt(rng.uniform()), a = c(3.2);
    const Eigen::Vector2d n(r * std::cos(a), r * std::sin(a));
    BrownConrady<double>::Matrix2 J = BrownConrady<double>::Matrix2::Zero();
    const auto d = lens.distort(n, &J);
    if (!d || J.determinant() < 0.1 || J.norm() > 20) continue;  // at the very end of the field
    const auto f = [&](const Eigen::Vector2d& m) -> Eigen::Vector2d { return *lens.distort(m); };
    if (k % 10 == 0) CHECK(test::relative_error(J, test::central_differences<2, 2>(f, n)) < 1e-6);
    const auto dual = lens.cast<Dual>().distort({Dual(n.x(), 2, 0), Dual(n.y(), 2, 1)});
    REQUIRE(dual);
    for (int i = 0; i < 2; ++i)
      CHECK((dual->coeff(i).derivatives().transpose() - J.row(i)).norm() < 1e-9 * (1 + J.norm()));
    const auto back = lens.undistort(*d);
    REQUIRE(back);
    CHECK((*back - n).norm() < 1e-9);
    ++inverted;
  }
  CHECK(inverted > 1800);
}

TEST_CASE_TEMPLATE("unproject inverts project behind fr1's lens", S, float, double) {
  test::Rng rng("brown conrady");
  const auto camera = kFr1Camera.cast<S>();
  for (int k = 0; k < 500; ++k) {
    const Eigen::Matrix<S, 2, 1> x(static_cast<S>(rng.uniform(0, 640)), static_cast<S>(rng.uniform(0, 480)));
    const S z = static_cast<S>(rng.uniform(0.3, 8));
    const auto p = camera.unproject(x, z);
    REQUIRE(p);
    CHECK(static_cast<double>(p->z()) == doctest::Approx(static_cast<double>(z)));
    CHECK(static_cast<double>((*camera.project(*p) - x).norm()) < (std::is_same_v<S, float> ? 5e-3 : 1e-8));
  }
  CHECK_FALSE(camera.project(Eigen::Matrix<S, 3, 1>(S(0), S(0), S(-1))));
}

TEST_CASE("the Jacobian of the projection through a lens equals central differences and dual numbers") {
  test::Rng rng("brown conrady jacobian");
  using Dual = Eigen::AutoDiffScalar<Eigen::Vector3d>;
  const auto dual_camera = kFr1Camera.cast<Dual>();
  const auto f = [](const Eigen::Vector3d& q) -> Eigen::Vector2d { return *kFr1Camera.project(q); };
  PinholeBrownConrady<double>::Jacobian J = PinholeBrownConrady<double>::Jacobian::Zero();
  for (int k = 0; k < 200; ++k) {
    const double z = rng.uniform(0.4, 6);
    const Eigen::Vector3d p(rng.uniform(-0.6, 0.6) * z, rng.uniform(-0.5, 0.5) * z, z);
    REQUIRE(kFr1Camera.project(p, &J));
    CHECK(test::relative_error(J, test::central_differences<2, 3>(f, p)) < 1e-7);
    Eigen::Matrix<Dual, 3, 1> dual;
    for (int i = 0; i < 3; ++i) dual(i) = Dual(p(i), 3, i);
    const auto x = dual_camera.project(dual);
    REQUIRE(x);
    for (int i = 0; i < 2; ++i) CHECK((x->coeff(i).derivatives().transpose() - J.row(i)).norm() < 1e-8);
  }
  const Eigen::Vector3d p(0.6, 0.5, 1);  // negative control: one flipped sign is seen
  REQUIRE(kFr1Camera.project(p, &J));
  J(1, 0) = -J(1, 0);
  CHECK(test::relative_error(J, test::central_differences<2, 3>(f, p)) > 0.01);
}

TEST_CASE_TEMPLATE("an inverse is right to 64 roundings, far out and at the end of the field, or refused", S,
                   float, double) {
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  test::Rng random("inverse of any lens");
  const double epsilon = to_double(Eigen::NumTraits<S>::epsilon());
  std::vector<BrownConrady<S>> lenses{
      {S(0.5), S(0.3), S(0), S(0), S(0.1)},  // Newton's method from the pixel itself needs more than 20 steps
      {S(-0.5), S(0), S(0), S(0), S(0)},
      {S(5), S(3), S(0), S(0), S(0.1), S(5.3), S(4), S(0.5)}};
  for (int n = 0; n < 20; ++n)
    lenses.push_back({S(random.uniform(-0.8, 0.8)), S(random.uniform(-0.8, 0.8)),
                      S(random.uniform(-0.01, 0.01)), S(random.uniform(-0.01, 0.01)),
                      S(random.uniform(-0.8, 0.8))});
  for (const BrownConrady<S>& lens : lenses) {
    CAPTURE(lens.coefficients().transpose());
    const double reach = std::min(lens.valid_radius(), 3.0);
    for (int n = 0; n < 500; ++n) {
      const double share = n % 2 == 0 ? random.uniform() : 1 - std::pow(10, random.uniform(-5, -2));
      const double around = random.uniform(0, 6.28);
      const Vector2 x(S(share * reach * std::cos(around)), S(share * reach * std::sin(around)));
      const auto d = lens.distort(x);
      if (!d) continue;
      const auto back = lens.undistort(*d);
      CAPTURE(x.transpose());
      REQUIRE(back);
      const auto again = lens.distort(*back);
      REQUIRE(again);
      CHECK(to_double((*again - *d).norm()) < 80 * epsilon * std::max(1.0, to_double(d->norm())));
    }
  }
}
