// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

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
  Vector3 mean_a(S(0), S(0), S(0)), mean_b = mean_a;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      mean_a[k] += a[i][k];
      mean_b[k] += b[i][k];
    }
  }
  for (int k = 0; k < 3; ++k) {
    mean_a[k] /= static_cast<S>(a.size());
    mean_b[k] /= static_cast<S>(a.size());
  }
  Matrix3 W = Matrix3::Zero();
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      for (int r = 0; r < 3; ++r) W(r, c) += (b[i][r] - mean_b[r]) * (a[i][c] - mean_a[c]);
    }
  }
  const Eigen::JacobiSVD<Matrix3> svd(W, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Vector3 s = svd.singularValues();
  if (!(s(0) > S(0)) || !(s(1) > S(100) * Eigen::NumTraits<S>::epsilon() * s(0))) return std::nullopt;
  Matrix3 U = svd.matrixU();
  if (U.determinant() * svd.matrixV().determinant() < S(0)) {
    for (int r = 0; r < 3; ++r) U(r, 2) = -U(r, 2);
  }
  const Matrix3 V_T = svd.matrixV().transpose(), R = detail::product<S>(U, V_T);
  const Vector3 moved = detail::product<S>(R, mean_a);
  return SE3<S>(SO3<S>(R), Vector3(mean_b[0] - moved[0], mean_b[1] - moved[1], mean_b[2] - moved[2]));
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
