// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <cstddef>
#include <optional>
#include <span>

#include "dynslam/geometry/se3.hpp"

namespace dynslam {

/// Rigid T_b_a that minimises sum |T a_i - b_i|^2 (Horn 1987, by SVD; no scale).
/// @return nullopt with fewer than 3 points or when they lie on one line (the rotation is free)
template <std::floating_point S>
[[nodiscard]] std::optional<SE3<S>> horn_alignment(std::span<const Eigen::Matrix<S, 3, 1>> a,
                                                   std::span<const Eigen::Matrix<S, 3, 1>> b) {
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  using Matrix3 = Eigen::Matrix<S, 3, 3>;
  if (a.size() != b.size() || a.size() < 3) return std::nullopt;
  Vector3 mean_a = Vector3::Zero(), mean_b = Vector3::Zero();
  for (std::size_t i = 0; i < a.size(); ++i) {
    mean_a += a[i];
    mean_b += b[i];
  }
  mean_a /= static_cast<S>(a.size());
  mean_b /= static_cast<S>(a.size());
  Matrix3 W = Matrix3::Zero();
  for (std::size_t i = 0; i < a.size(); ++i) W += (b[i] - mean_b) * (a[i] - mean_a).transpose();
  const Eigen::JacobiSVD<Matrix3> svd(W, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Vector3 s = svd.singularValues();
  if (!(s(0) > S(0)) || !(s(1) > S(100) * Eigen::NumTraits<S>::epsilon() * s(0))) return std::nullopt;
  Matrix3 D = Matrix3::Identity();
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < S(0)) D(2, 2) = S(-1);
  const Matrix3 R = svd.matrixU() * D * svd.matrixV().transpose();
  return SE3<S>(SO3<S>(R), mean_b - R * mean_a);
}

}  // namespace dynslam
