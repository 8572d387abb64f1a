// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/geometry/p3p.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>

#include "random.hpp"

using namespace dynslam;

TEST_CASE("the true pose is among those of three points, and all of them see the points where they are") {
  test::Rng rng("p3p");
  int solutions = 0;
  for (int k = 0; k < 2000; ++k) {
    SE3d::Vector6 xi;
    for (int i = 0; i < 6; ++i) xi(i) = rng.uniform(-2, 2);
    const SE3d T = SE3d::exp(xi);
    Eigen::Matrix3d rays, points;
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3d p =
          Eigen::Vector3d(rng.uniform(-0.6, 0.6), rng.uniform(-0.5, 0.5), 1) * rng.uniform(1, 8);
      rays.col(i) = p.normalized();
      points.col(i) = T.inverse() * p;
    }
    std::array<SE3d, 4> found;
    const int n = perspective_three_point(rays, points, found);
    solutions += n;
    double nearest = 10;
    for (int s = 0; s < n; ++s) {
      const SE3d& pose = found[static_cast<std::size_t>(s)];
      nearest = std::min(nearest, (pose * T.inverse()).log().norm());
      for (int i = 0; i < 3; ++i)
        CHECK(((pose * Eigen::Vector3d(points.col(i))).normalized() - rays.col(i)).norm() < 1e-6);
    }
    CHECK(nearest < 1e-5);
  }
  CHECK(solutions > 2000);
  CHECK(solutions < 6000);
}

TEST_CASE("the camera over the middle of an equilateral triangle, where solutions meet, has its pose") {
  Eigen::Matrix3d points;
  points << 1, -0.5, -0.5, 0, 0.8660254037844386, -0.8660254037844386, 2, 2, 2;
  const Eigen::Matrix3d rays = points.colwise().normalized();
  std::array<SE3d, 4> found;
  const int n = perspective_three_point(rays, points, found);
  double nearest = 10;
  for (int s = 0; s < n; ++s) nearest = std::min(nearest, found[static_cast<std::size_t>(s)].log().norm());
  CHECK(nearest < 1e-5);
}

TEST_CASE("points on a line, or in one place, leave the pose open") {
  Eigen::Matrix3d line;
  line << 0, 0.5, 1, 0, 0.25, 0.5, 2, 2.5, 3;
  std::array<SE3d, 4> found;
  CHECK(perspective_three_point(line.colwise().normalized(), line, found) == 0);
  const Eigen::Matrix3d one = Eigen::Vector3d(0.1, 0.2, 2).replicate<1, 3>();
  CHECK(perspective_three_point(one.colwise().normalized(), one, found) == 0);
}
