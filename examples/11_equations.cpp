// SPDX-License-Identifier: BSD-3-Clause
//
// Example 11: Equations 3 to 8 of the paper, one function each, with numbers that one can work out by hand.
#include <cmath>
#include <cstdint>
#include <cstdio>

#include <Eigen/Core>
#include <dynslam/dynamics/classify.hpp>
#include <dynslam/dynamics/residuals.hpp>
#include <dynslam/dynamics/static_weight.hpp>
#include <dynslam/geometry/epipolar.hpp>
#include <dynslam/geometry/pinhole.hpp>
#include <dynslam/geometry/se3.hpp>
#include <dynslam/image/image.hpp>
#include <dynslam/robust/t_distribution.hpp>

namespace {

using Eigen::Vector2d, Eigen::Vector3d;

/// Eq (3), the photometric error I_ref(x) - I_cur(x'): 120 - (0.75 * 100 + 0.25 * 102) grey values.
double photometric_error() {
  const dynslam::Image<std::uint8_t> reference(4, 4, 120);
  dynslam::Image<std::uint8_t> current(4, 4, 100);
  current(2, 1) = 102;
  const Vector2d x(1.0, 1.0), x_projected(1.25, 1.0);  // between pixels: bilinear
  const auto e = dynslam::photometric_residual(reference, x, current, x_projected);
  return e.value();  // empty where x or x' lies outside its image
}

/// Eq (4), the weight of a scalar error: (nu + 1) / (nu + (E / sigma)^2) = 6 / (5 + 2^2).
double scalar_weight() {
  const auto kernel = dynslam::TDistribution<double>::with_dimension(5.0, 1);  // nu, d
  const double e = 8.0, sigma = 4.0;                                           // grey values
  return kernel.weight((e / sigma) * (e / sigma));
}

/// Eq (5), the reprojection error |x' - x_m|: of 3 and 4 px.
double reprojection_error() {
  const Vector2d x_projected(103.0, 204.0), x_match(100.0, 200.0);
  return dynslam::reprojection_residual(x_projected, x_match);
}

/// Eq (6), the depth error (T P)_z - D(x_m): 2.25 - 2 m.
double depth_error() {
  const dynslam::Image<double> depth(4, 4, 2.0);
  const Vector3d p_c(0.1, 0.2, 2.25);  // the point in the current camera's frame
  const auto e = dynslam::depth_residual(p_c, depth, Vector2d(2.0, 1.0));
  return e.value();  // empty where the depth is not valid
}

/// Eq (7), the static weight of all three: (5 + 3) / (5 + (10 / 5)^2 + (2 / 1)^2 + (0.06 / 0.02)^2) = 8 / 22.
double static_weight() {
  const dynslam::KeypointResiduals<double> e{10.0, 2.0, 0.06};  // grey values, px, m
  const dynslam::StaticWeightScales<double> sigma{5.0, 1.0, 0.02};
  return dynslam::static_weight(e, sigma, 5.0);
}

/// Eq (7) without the depth error: (5 + 2) / (5 + 4 + 4) = 7 / 13.
double static_weight_without_depth() {
  const dynslam::KeypointResiduals<double> e{10.0, 2.0, {}};
  const dynslam::StaticWeightScales<double> sigma{5.0, 1.0, 0.02};
  return dynslam::static_weight(e, sigma, 5.0);
}

/// Eq (8), the epipolar constraint: of a camera that moved sideways epipolar lines are rows, and a match that
/// is 3 rows lower is 3 px off its line.
double epipolar_distance() {
  const dynslam::Pinhole<double> camera(500.0, 500.0, 320.0, 240.0);
  const dynslam::SE3d T_cur_ref(dynslam::SO3d(), Vector3d(-0.1, 0.0, 0.0));
  const Eigen::Matrix3d F = dynslam::fundamental_from_pose(camera, camera, T_cur_ref);
  return dynslam::line_distance(F, Vector2d(300.0, 200.0), Vector2d(275.0, 203.0));
}

bool check(const char* name, double value, double by_hand) {
  const bool right = std::abs(value - by_hand) < 1e-9;
  std::printf("%-36s %9.6f   by hand %9.6f%s\n", name, value, by_hand, right ? "" : "   WRONG");
  return right;
}

}  // namespace

int main() {
  bool right = check("(3) photometric error [grey values]", photometric_error(), 19.5);
  right &= check("(4) weight of a scalar error", scalar_weight(), 6.0 / 9.0);
  right &= check("(5) reprojection error [px]", reprojection_error(), 5.0);
  right &= check("(6) depth error [m]", depth_error(), 0.25);
  right &= check("(7) static weight", static_weight(), 8.0 / 22.0);
  right &= check("(7) static weight without depth", static_weight_without_depth(), 7.0 / 13.0);
  right &= check("(8) distance to the epipolar line [px]", epipolar_distance(), 3.0);
  right &= !dynslam::is_dynamic(static_weight(), 0.25);  // tau: a weight below it is a moving keypoint's
  std::puts(right ? "as expected" : "NOT as expected");
  return right ? 0 : 1;
}
