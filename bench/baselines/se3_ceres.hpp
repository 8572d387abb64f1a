// SPDX-License-Identifier: BSD-3-Clause
// Poses as Ceres' parameters: seven numbers, changed from the left by exp of six, so that cost functions give
// the Jacobians that dynslam has, in closed form.
#pragma once

#include <ceres/ceres.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>

#include "dynslam/geometry/se3.hpp"

namespace dynslam::baselines {

/// Quaternion (x, y, z, w), then translation.
using CeresPose = std::array<double, 7>;

[[nodiscard]] inline CeresPose to_ceres(const SE3d& T) {
  const Eigen::Quaterniond q(T.rotation_matrix());
  const Eigen::Vector3d& t = T.translation();
  return {q.x(), q.y(), q.z(), q.w(), t.x(), t.y(), t.z()};
}
[[nodiscard]] inline SE3d from_ceres(const double* p) {
  return SE3d(Eigen::Quaterniond(p[3], p[0], p[1], p[2]), Eigen::Vector3d(p[4], p[5], p[6]));
}

/// Its Jacobian is [I; 0]: cost functions give their derivatives by the six numbers in the first six columns.
class LeftPoses : public ceres::Manifold {
 public:
  [[nodiscard]] int AmbientSize() const override { return 7; }
  [[nodiscard]] int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* delta, double* out) const override {
    const auto moved =
        to_ceres(SE3d::exp(Eigen::Map<const Eigen::Matrix<double, 6, 1>>(delta)) * from_ceres(x));
    std::copy(moved.begin(), moved.end(), out);
    return true;
  }
  bool PlusJacobian(const double*, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, 7, 6, Eigen::RowMajor>>(jacobian).setIdentity();
    return true;
  }
  bool Minus(const double* y, const double* x, double* delta) const override {
    Eigen::Map<Eigen::Matrix<double, 6, 1>>(delta, 6) = (from_ceres(y) * from_ceres(x).inverse()).log();
    return true;
  }
  bool MinusJacobian(const double*, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, 6, 7, Eigen::RowMajor>>(jacobian).setIdentity();
    return true;
  }
};

}  // namespace dynslam::baselines
