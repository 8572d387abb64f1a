// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/geometry/minimal_models.hpp"

#include <doctest/doctest.h>

#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>

#include "dynslam/geometry/se3.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

/// A camera's step, and points that both views see: on a plane, or anywhere.
struct StepViews {
  Eigen::Matrix<double, 3, 20> p, q;
  Eigen::Matrix3d E, H;  // of the step and the plane
};

StepViews step_views(test::Rng& rng, bool plane) {
  Eigen::Matrix<double, 6, 1> twist;
  for (int i = 0; i < 6; ++i) twist[i] = rng.uniform(-0.3, 0.3);
  const SE3d T = SE3d::exp(twist);
  const Eigen::Vector3d normal = Eigen::Vector3d(0.2, -0.1, 1).normalized(), t = T.translation();
  const Eigen::Matrix3d R = T.matrix().topLeftCorner<3, 3>();
  StepViews views;
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector3d ray(rng.uniform(-0.5, 0.5), rng.uniform(-0.4, 0.4), 1);
    const Eigen::Vector3d P = ray * (plane ? 2 / normal.dot(ray) : rng.uniform(1, 5));
    views.p.col(i) = ray;
    views.q.col(i) = (T * P) / (T * P).z();
  }
  Eigen::Matrix3d cross;
  cross << 0, -t.z(), t.y(), t.z(), 0, -t.x(), -t.y(), t.x(), 0;
  views.E = cross * R;
  views.H = R + t * normal.transpose() / 2;
  return views;
}

/// Largest error of |q^T F p| over the matches; F has norm 1.
double worst_of(const Eigen::Matrix3d& F, const StepViews& views) {
  double result = 0;
  for (int i = 0; i < 20; ++i) result = std::max(result, std::abs(views.q.col(i).dot(F * views.p.col(i))));
  return result;
}

}  // namespace

TEST_CASE("one of the F of seven matches is the step's, and each has rank 2 and fits the seven") {
  test::Rng rng("seven matches");
  int found = 0, several = 0;
  for (int scene = 0; scene < 200; ++scene) {
    const StepViews views = step_views(rng, false);
    std::array<Eigen::Matrix3d, 3> F;
    const int n = fundamental_seven_point(views.p.leftCols<7>(), views.q.leftCols<7>(), F);
    REQUIRE(n >= 1);
    several += n > 1 ? 1 : 0;
    double best = 1;
    for (int k = 0; k < n; ++k) {
      const Eigen::Matrix3d& one = F[static_cast<std::size_t>(k)];
      CHECK(std::abs(one.norm() - 1) < 1e-12);
      CHECK(std::abs(one.determinant()) < 1e-7);
      for (int i = 0; i < 7; ++i) CHECK(std::abs(views.q.col(i).dot(one * views.p.col(i))) < 1e-7);
      best = std::min(best, worst_of(one, views));
    }
    found += best < 1e-6 ? 1 : 0;
  }
  CHECK(found >= 198);  // a double root keeps half of the digits
  CHECK(several > 20);
}

TEST_CASE("seven matches of which two are the same leave no single pencil") {
  test::Rng rng("a match twice");
  StepViews views = step_views(rng, false);
  views.p.col(6) = views.p.col(0);
  views.q.col(6) = views.q.col(0);
  std::array<Eigen::Matrix3d, 3> F;
  CHECK(fundamental_seven_point(views.p.leftCols<7>(), views.q.leftCols<7>(), F) == 0);
}

TEST_CASE("the H of four matches on a plane is the plane's") {
  test::Rng rng("four matches");
  for (int scene = 0; scene < 200; ++scene) {
    const StepViews views = step_views(rng, true);
    const auto H = homography_four_point(views.p.leftCols<4>(), views.q.leftCols<4>());
    if (!H) continue;  // three nearly on a line
    const Eigen::Matrix3d truth = views.H / views.H.norm();
    CHECK(std::min((*H - truth).norm(), (*H + truth).norm()) < 1e-6);
  }
}

TEST_CASE("no H where three points are on a line, or the four are seen in another order") {
  Eigen::Matrix<double, 3, 4> square, line, crossed;
  square << 0, 1, 1, 0, 0, 0, 1, 1, 1, 1, 1, 1;
  line << 0, 1, 2, 0, 0, 0, 0, 1, 1, 1, 1, 1;
  crossed << 0, 1, 0, 1, 0, 0, 1, 1, 1, 1, 1, 1;
  CHECK(homography_four_point(square, square));
  CHECK_FALSE(homography_four_point(line, square));
  CHECK_FALSE(homography_four_point(square, line));
  CHECK_FALSE(homography_four_point(square, crossed));
}
