// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/geometry/minimal_models.hpp"

#include <doctest/doctest.h>

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "dynslam/geometry/se3.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

/// A camera's step, and points that both views see: on a plane, or anywhere.
struct StepViews {
  Eigen::Matrix<double, 3, 20> p, q;
  Eigen::Matrix3d E, H;  // of the step and the plane
};

StepViews step_views(test::Rng& rng, bool plane, const SE3d& T) {
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

StepViews step_views(test::Rng& rng, bool plane) {
  Eigen::Matrix<double, 6, 1> twist;
  for (int i = 0; i < 6; ++i) twist[i] = rng.uniform(-0.3, 0.3);
  return step_views(rng, plane, SE3d::exp(twist));
}

/// All F of rank 2 of seven matches by other means: the null space by SVD, and the cubic's changes of sign,
/// halved to the last digit, once around the pencil.
std::vector<Eigen::Matrix3d> seven_point_oracle(const StepViews& views) {
  Eigen::Matrix<double, 7, 9> A;
  for (int k = 0; k < 7; ++k) {
    for (int i = 0; i < 9; ++i) A(k, i) = views.q(i / 3, k) * views.p(i % 3, k);
  }
  const Eigen::JacobiSVD<Eigen::Matrix<double, 7, 9>> svd(A, Eigen::ComputeFullV);
  const auto at = [&](double angle) {
    const Eigen::Matrix<double, 9, 1> f =
        std::cos(angle) * svd.matrixV().col(7) + std::sin(angle) * svd.matrixV().col(8);
    return Eigen::Matrix3d(Eigen::Matrix3d(Eigen::Map<const Eigen::Matrix3d>(f.data())).transpose());
  };
  std::vector<Eigen::Matrix3d> found;
  constexpr int kSteps = 7200;
  const double step = std::acos(-1.0) / kSteps;
  for (int i = 0; i < kSteps; ++i) {
    double low = i * step, high = low + step;
    const double first = at(low).determinant();
    if (first * at(high).determinant() > 0) continue;
    for (int k = 0; k < 60; ++k) {
      const double middle = 0.5 * (low + high);
      (first * at(middle).determinant() > 0 ? low : high) = middle;
    }
    found.push_back(at(0.5 * (low + high)));
  }
  return found;
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

TEST_CASE("seven matches keep all their F where the camera moves along an axis, and in rectified views") {
  // Fault: 0 of 272 for a motion along y, 0 of 290 along z, 180 of 280 along x.
  test::Rng rng("seven matches along axes");
  const auto turned = [](double x, double y, double z, const Eigen::Vector3d& t) {
    return SE3d(SO3<double>::exp(Eigen::Vector3d(x, y, z)), t);
  };
  const double right = 0.5 * std::acos(-1.0);
  struct Motion {
    std::string name;
    SE3d T;
  };
  const Motion motions[] = {
      {"x", turned(0, 0, 0, {0.3, 0, 0})},
      {"y", turned(0, 0, 0, {0, 0.3, 0})},
      {"z", turned(0, 0, 0, {0, 0, 0.3})},
      {"minus y", turned(0, 0, 0, {0, -0.3, 0})},
      {"xy", turned(0, 0, 0, {0.2, 0.2, 0})},
      {"y, turned about y", turned(0, 0.1, 0, {0, 0.3, 0})},
      {"z, turned about z", turned(0, 0, 0.1, {0, 0, 0.3})},
      {"y, turned by 90 degrees about z", turned(0, 0, right, {0, 0.3, 0})},
      {"orbit", turned(0, 0.1, 0, {0.3, 0, 0.03})},
  };
  for (const Motion& motion : motions) {
    CAPTURE(motion.name);
    int wanted = 0, missed = 0, of_step = 0;
    for (int scene = 0; scene < 100; ++scene) {
      const StepViews views = step_views(rng, false, motion.T);
      std::array<Eigen::Matrix3d, 3> F;
      const int n = fundamental_seven_point(views.p.leftCols<7>(), views.q.leftCols<7>(), F);
      double best = 1;
      for (int k = 0; k < n; ++k) best = std::min(best, worst_of(F[static_cast<std::size_t>(k)], views));
      of_step += best < 1e-6 ? 1 : 0;
      for (const Eigen::Matrix3d& one : seven_point_oracle(views)) {
        double nearest = 2;
        for (int k = 0; k < n; ++k) {
          const Eigen::Matrix3d& ours = F[static_cast<std::size_t>(k)];
          nearest = std::min({nearest, (ours - one).norm(), (ours + one).norm()});
        }
        ++wanted;
        missed += nearest < 1e-4 ? 0 : 1;
      }
    }
    CHECK(wanted >= 100);
    CHECK(missed == 0);
    CHECK(of_step >= 98);  // a double root keeps half of the digits
  }
}

TEST_CASE("of four points as a camera sees them that moves along an axis, H is the plane's") {
  test::Rng rng("four matches along axes");
  for (const Eigen::Vector3d& t : {Eigen::Vector3d(0.3, 0, 0), Eigen::Vector3d(0, 0.3, 0),
                                   Eigen::Vector3d(0, 0, 0.3), Eigen::Vector3d(0, 0, 0)}) {
    const StepViews views = step_views(rng, true, SE3d(SO3<double>(), t));
    // A square whose sides are the axes', so that most numbers are the same or 0.
    Eigen::Matrix<double, 3, 4> p, q;
    p << -0.5, 0.5, 0.5, -0.5, -0.5, -0.5, 0.5, 0.5, 1, 1, 1, 1;
    for (int k = 0; k < 4; ++k) q.col(k) = (views.H * p.col(k)).hnormalized().homogeneous();
    const auto H = homography_four_point(p, q);
    REQUIRE(H);
    const Eigen::Matrix3d truth = views.H / views.H.norm();
    CHECK(std::min((*H - truth).norm(), (*H + truth).norm()) < 1e-9);
  }
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
