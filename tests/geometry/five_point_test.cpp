// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/geometry/five_point.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>

#include "dynslam/geometry/essential.hpp"
#include "moved_camera.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

/// Five points that two views see: on a plane, or anywhere. @return of their E to the nearest solution
double nearest_of_five(test::Rng& rng, bool plane, const SE3d& T, int& solutions) {
  Eigen::Matrix<double, 3, 5> p, q;
  for (int i = 0; i < 5; ++i) {
    const Eigen::Vector3d ray(rng.uniform(-0.6, 0.6), rng.uniform(-0.5, 0.5), 1);
    const Eigen::Vector3d P = ray * (plane ? 2 / (1 + 0.3 * ray.x() - 0.1 * ray.y()) : rng.uniform(1, 5));
    p.col(i) = ray.normalized();
    q.col(i) = (T * P).normalized();
  }
  Eigen::Matrix3d E = essential_from_pose(T);
  E /= E.norm();
  std::array<Eigen::Matrix3d, 10> found;
  solutions = essential_five_point(p, q, found);
  double nearest = 2;
  for (int k = 0; k < solutions; ++k) {
    const Eigen::Matrix3d& e = found[static_cast<std::size_t>(k)];
    nearest = std::min({nearest, (e - E).norm(), (e + E).norm()});
    CHECK(e.norm() == doctest::Approx(1));
    for (int i = 0; i < 5; ++i) CHECK(std::abs(q.col(i).dot(e * p.col(i))) < 1e-9);
    CHECK(std::abs(e.determinant()) < 1e-3);
  }
  return nearest;
}

}  // namespace

TEST_CASE("the true E is among the solutions of five matches, on a plane, too") {
  test::Rng rng("five points");
  for (const bool plane : {false, true}) {
    int missed = 0, all = 0;
    for (int k = 0; k < 500; ++k) {
      const SE3d T = test::moved(rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5),
                                 rng.uniform(-0.4, 0.4));
      int solutions = 0;
      missed += nearest_of_five(rng, plane, T, solutions) < 1e-4 ? 0 : 1;
      all += solutions;
    }
    CAPTURE(plane);
    CHECK(missed <= 5);  // two solutions that nearly are one
    CHECK(all > 500);
    CHECK(all < 5000);
  }
}

TEST_CASE("a step along an axis without a turn has its E") {
  test::Rng rng("five points axis");
  for (const Eigen::Vector3d& t :
       {Eigen::Vector3d(0.2, 0, 0), Eigen::Vector3d(0, 0.2, 0), Eigen::Vector3d(0, 0, 0.2)}) {
    int found = 0;
    for (int k = 0; k < 50; ++k) {
      int solutions = 0;
      found += nearest_of_five(rng, false, SE3d(SO3d(), t), solutions) < 1e-3 ? 1 : 0;
    }
    CHECK(found >= 45);
  }
}

TEST_CASE("four different matches and one twice leave no E") {
  Eigen::Matrix<double, 3, 5> p, q;
  test::Rng rng("five points twice");
  for (int i = 0; i < 5; ++i) {
    p.col(i) = Eigen::Vector3d(rng.uniform(-1, 1), rng.uniform(-1, 1), 1);
    q.col(i) = Eigen::Vector3d(rng.uniform(-1, 1), rng.uniform(-1, 1), 1);
  }
  p.col(4) = p.col(0);
  q.col(4) = q.col(0);
  std::array<Eigen::Matrix3d, 10> found;
  CHECK(essential_five_point(p, q, found) == 0);
}

TEST_CASE("roots of a polynomial are where it was made of them") {
  test::Rng rng("polynomial roots");
  for (int k = 0; k < 200; ++k) {
    std::array<double, 7> polynomial{1};
    std::array<double, 6> roots, found;
    for (std::size_t i = 0; i < 6; ++i) {
      roots[i] = i < 4 ? rng.uniform(-1.5, 1.5) : rng.uniform(2, 9);
      for (std::size_t j = i + 1; j-- > 0;) {  // times (z - root)
        polynomial[j + 1] += polynomial[j];
        polynomial[j] *= -roots[i];
      }
    }
    // Coefficients were gathered the highest first.
    const int n = detail::polynomial_roots(polynomial, found);
    CHECK(n >= 4);
    for (int i = 0; i < n; ++i) {
      double nearest = 1;
      for (const double root : roots)
        nearest = std::min(nearest, std::abs(root - found[static_cast<std::size_t>(i)]));
      CHECK(nearest < 1e-4);
    }
  }
}
