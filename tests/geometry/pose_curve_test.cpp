// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/geometry/pose_curve.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <type_traits>
#include <vector>

#include "pose_distance.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

template <class S>
constexpr double kCurveTolerance = std::is_same_v<S, float> ? 2e-6 : 1e-12;

Eigen::Matrix<double, 6, 1> random_twist(test::Rng& rng, double size) {
  Eigen::Matrix<double, 6, 1> xi;
  for (int i = 0; i < 6; ++i) xi[i] = size * rng.normal();
  return xi;
}

}  // namespace

TEST_CASE_TEMPLATE("a motion goes through its poses, and between two at constant velocity", S, float,
                   double) {
  test::Rng rng("motion through two poses");
  for (int trial = 0; trial < 20; ++trial) {
    const auto speed = random_twist(rng, 0.5);
    const SE3<double> start = SE3<double>::exp(random_twist(rng, 1));
    const auto pose = [&](double t) {
      return TimedPose<S>{t, (SE3<double>::exp(speed * t) * start).template cast<S>()};
    };
    const std::vector<TimedPose<S>> two{pose(0.1), pose(0.4)};
    for (const auto& p : two) CHECK(test::pose_distance(pose_between<S>(two, p.t), p.T) < kCurveTolerance<S>);
    for (const double t : {0.15, 0.25, 0.39})
      CHECK(test::pose_distance(pose_between<S>(two, t), pose(t).T) < kCurveTolerance<S>);
    CHECK(test::pose_distance(pose_between<S>(std::span(two).first(1), 5.0), two[0].T) < kCurveTolerance<S>);
  }
}

TEST_CASE("more poses follow a camera whose velocity changes more closely") {
  // A hand that swings with 2 Hz; a gap of 0.2 s, and two poses on either side of it.
  const auto pose = [](double t) {
    Eigen::Matrix<double, 6, 1> xi;
    xi << 0.05 * std::sin(12 * t), 0.03 * std::cos(11 * t), 0.02 * t, 0.1 * std::sin(9 * t), 0.05 * t, 0.02;
    return TimedPose<double>{t, SE3<double>::exp(xi)};
  };
  const std::vector<TimedPose<double>> poses{pose(0.067), pose(0.1), pose(0.3), pose(0.333)};
  const auto error = [&](std::span<const TimedPose<double>> through, double t) {
    return test::pose_distance(pose_between<double>(through, t), pose(t).T);
  };
  for (const double t : {0.13, 0.17, 0.2, 0.23, 0.27}) {
    const double two = error(std::span(poses).subspan(1, 2), t), three = error(std::span(poses).first(3), t),
                 four = error(poses, t);
    CHECK(three < two);
    CHECK(four < 0.5 * two);
    CHECK(four < 0.03);
  }
  std::vector<TimedPose<double>> shuffled{poses[2], poses[0], poses[3], poses[1]};
  CHECK(test::pose_distance(pose_between<double>(shuffled, 0.22), pose_between<double>(poses, 0.22)) < 1e-12);
}
