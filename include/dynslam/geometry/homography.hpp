// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <type_traits>

#include "dynslam/concepts/scalar.hpp"
#include "dynslam/geometry/hartley.hpp"
#include "dynslam/robust/consensus.hpp"

namespace dynslam {

/// H x in pixels; nullopt at infinity and beyond.
template <Scalar S>
[[nodiscard]] std::optional<Eigen::Matrix<S, 2, 1>> transfer(
    const Eigen::Matrix<S, 3, 3>& H, const std::type_identity_t<Eigen::Matrix<S, 2, 1>>& x) {
  const Eigen::Matrix<S, 3, 1> p = H * x.homogeneous();
  if (!(S(1e-12) < p.z())) return std::nullopt;
  return Eigen::Matrix<S, 2, 1>(p.x() / p.z(), p.y() / p.z());
}

/// Transfer error |H x - x_m|^2 [px^2]; infinite where H x is at infinity.
template <Scalar S>
[[nodiscard]] S transfer_distance_squared(const Eigen::Matrix<S, 3, 3>& H,
                                          const std::type_identity_t<Eigen::Matrix<S, 2, 1>>& x,
                                          const std::type_identity_t<Eigen::Matrix<S, 2, 1>>& x_m) {
  const auto there = transfer<S>(H, x);
  if (!there) return S(std::numeric_limits<double>::infinity());
  return (*there - x_m).squaredNorm();
}

/// Symmetric transfer error |H x - x_m|^2 + |H^-1 x_m - x|^2 [px^2].
template <Scalar S>
[[nodiscard]] S symmetric_transfer_distance_squared(
    const Eigen::Matrix<S, 3, 3>& H, const std::type_identity_t<Eigen::Matrix<S, 3, 3>>& H_inverse,
    const std::type_identity_t<Eigen::Matrix<S, 2, 1>>& x,
    const std::type_identity_t<Eigen::Matrix<S, 2, 1>>& x_m) {
  return transfer_distance_squared<S>(H, x, x_m) + transfer_distance_squared<S>(H_inverse, x_m, x);
}

/// Normalised direct linear transform (Hartley and Zisserman, Alg. 4.2): H with x_m ~ H x, |H| = 1 and
/// H x in front (a positive third component for the data). `index` selects matches; empty: all. Solved in
/// double for any scalar.
/// @return nullopt with fewer than 4 matches or when they leave more than one H (three on a line of four)
template <std::floating_point S>
[[nodiscard]] std::optional<Eigen::Matrix<S, 3, 3>> homography_dlt(
    std::span<const Eigen::Matrix<S, 2, 1>> x, std::span<const Eigen::Matrix<S, 2, 1>> x_m,
    std::span<const int> index = {}) {
  using W = std::common_type_t<S, double>;
  using Matrix3 = Eigen::Matrix<W, 3, 3>;
  using Matrix9 = Eigen::Matrix<W, 9, 9>;
  using Row9 = Eigen::Matrix<W, 1, 9>;
  const std::size_t n = index.empty() ? std::min(x.size(), x_m.size()) : index.size();
  if (n < 4) return std::nullopt;
  const auto at = [&](std::size_t k) { return index.empty() ? k : static_cast<std::size_t>(index[k]); };
  const auto first = [&](std::size_t k) -> Eigen::Matrix<W, 2, 1> { return x[at(k)].template cast<W>(); };
  const auto second = [&](std::size_t k) -> Eigen::Matrix<W, 2, 1> { return x_m[at(k)].template cast<W>(); };
  Matrix3 T, T_m;
  if (!detail::normalising_transform<W>(n, first, T) || !detail::normalising_transform<W>(n, second, T_m)) {
    return std::nullopt;
  }
  Matrix9 AtA = Matrix9::Zero();
  for (std::size_t k = 0; k < n; ++k) {
    const Eigen::Matrix<W, 3, 1> p = T * first(k).homogeneous(), q = T_m * second(k).homogeneous();
    Row9 a = Row9::Zero(), b = Row9::Zero();
    a.template segment<3>(3) = -p.transpose();
    a.template tail<3>() = q.y() * p.transpose();
    b.template head<3>() = p.transpose();
    b.template tail<3>() = -q.x() * p.transpose();
    AtA.template selfadjointView<Eigen::Lower>().rankUpdate(a.transpose());
    AtA.template selfadjointView<Eigen::Lower>().rankUpdate(b.transpose());
  }
  const Eigen::SelfAdjointEigenSolver<Matrix9> eigen(AtA);
  if (eigen.info() != Eigen::Success) return std::nullopt;
  if (!(eigen.eigenvalues()(1) > W(1e3) * Eigen::NumTraits<W>::epsilon() * eigen.eigenvalues()(8)))
    return std::nullopt;
  const Eigen::Matrix<W, 9, 1> h = eigen.eigenvectors().col(0);
  Matrix3 H;
  H << h(0), h(1), h(2), h(3), h(4), h(5), h(6), h(7), h(8);
  H = (T_m.inverse() * H * T).eval();
  const W norm = H.norm();
  if (!(norm > W(0)) || !std::isfinite(norm)) return std::nullopt;
  const W sign = (H.row(2) * first(0).homogeneous())(0) < W(0) ? W(-1) : W(1);
  return (sign / norm * H).template cast<S>();
}

/// H by RANSAC over samples of four, refined on its inliers, judged by the transfer error.
template <std::floating_point S>
[[nodiscard]] RansacOutcome<Eigen::Matrix<S, 3, 3>> homography_ransac(
    std::span<const Eigen::Matrix<S, 2, 1>> x, std::span<const Eigen::Matrix<S, 2, 1>> x_m,
    const RansacOptions<S>& options, RansacWorkspace& workspace) {
  using Matrix3 = Eigen::Matrix<S, 3, 3>;
  return inlier_consensus<4, Matrix3>(
      std::min(x.size(), x_m.size()), options,
      [&](std::span<const int> index) { return homography_dlt<S>(x, x_m, index); },
      [&](const Matrix3& H, std::size_t i) { return transfer_distance_squared<S>(H, x[i], x_m[i]); },
      workspace);
}

}  // namespace dynslam
