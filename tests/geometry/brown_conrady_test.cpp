// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/geometry/brown_conrady.hpp"

#include <doctest/doctest.h>

#include <unsupported/Eigen/AutoDiff>

#include "jacobian.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {
const Pinhole<double> kFr1(517.306, 516.469, 318.643, 255.314);
const BrownConrady<double> kFr1Lens(0.262383, -0.953104, -0.005358, 0.002628, 1.163314);
const PinholeBrownConrady<double> kFr1Camera(kFr1, kFr1Lens);
}  // namespace

TEST_CASE_TEMPLATE("fr1's distortion is inverted over the whole image", S, float, double) {
  const PinholeBrownConrady<S> camera(kFr1.cast<S>(), kFr1Lens.cast<S>());
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
    BrownConrady<double>::Matrix2 J;
    (void)kFr1Lens.distort(n, &J);
    const auto f = [](const Eigen::Vector2d& m) -> Eigen::Vector2d { return kFr1Lens.distort(m); };
    CHECK(test::relative_error(J, test::central_differences<2, 2>(f, n)) < 1e-8);
  }
}

TEST_CASE("a point far outside the lens' field has no inverse instead of a wrong one") {
  const BrownConrady<double> folding(-0.5, 0, 0, 0, 0);  // r (1 - r^2 / 2) never exceeds 0.55
  CHECK_FALSE(folding.undistort(Eigen::Vector2d(0.9, 0.0)));
  CHECK(folding.undistort(Eigen::Vector2d(0.3, 0.1)));
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
  PinholeBrownConrady<double>::Jacobian J;
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
