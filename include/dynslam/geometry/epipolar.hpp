// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "dynslam/geometry/hartley.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/robust/consensus.hpp"

namespace dynslam {

/// Epipolar line F x in the second image, scaled so that (a, b) is a unit vector: a u + b v + c is a
/// signed distance in pixels. A point at the epipole has no line: the zero vector.
template <Scalar S>
[[nodiscard]] Eigen::Matrix<S, 3, 1> epipolar_line(const Eigen::Matrix<S, 3, 3>& F,
                                                   const std::type_identity_t<Eigen::Matrix<S, 2, 1>>& x) {
  using std::sqrt;
  const Eigen::Matrix<S, 3, 1> line = F * x.homogeneous();
  const S norm = sqrt(line.x() * line.x() + line.y() * line.y());
  if (!(S(0) < norm)) return Eigen::Matrix<S, 3, 1>::Zero();
  return line / norm;
}

/// Distance of the match x_m to the epipolar line of x [px] (Eq 8 as a distance).
template <Scalar S>
[[nodiscard]] S line_distance(const Eigen::Matrix<S, 3, 3>& F,
                              const std::type_identity_t<Eigen::Matrix<S, 2, 1>>& x,
                              const std::type_identity_t<Eigen::Matrix<S, 2, 1>>& x_m) {
  using std::abs;
  return abs(epipolar_line<S>(F, x).dot(x_m.homogeneous()));
}

/// Sampson's first-order geometric error, squared [px^2]; infinite where its gradient vanishes.
template <Scalar S>
[[nodiscard]] S sampson_distance_squared(const Eigen::Matrix<S, 3, 3>& F,
                                         const std::type_identity_t<Eigen::Matrix<S, 2, 1>>& x,
                                         const std::type_identity_t<Eigen::Matrix<S, 2, 1>>& x_m) {
  const Eigen::Matrix<S, 3, 1> l = F * x.homogeneous(), l_m = F.transpose() * x_m.homogeneous();
  const S e = x_m.homogeneous().dot(l);
  const S gradient = l.x() * l.x() + l.y() * l.y() + l_m.x() * l_m.x() + l_m.y() * l_m.y();
  if (!(S(0) < gradient)) return std::numeric_limits<S>::infinity();
  return e * e / gradient;
}

/// F of two calibrated views: K_cur^-T [t]x R K_ref^-1 with T_cur_ref = (R, t). Zero for t = 0.
template <Scalar S>
[[nodiscard]] Eigen::Matrix<S, 3, 3> fundamental_from_pose(const Pinhole<S>& reference,
                                                           const Pinhole<S>& current,
                                                           const SE3<S>& T_cur_ref) {
  return current.K().inverse().transpose() * SO3<S>::hat(T_cur_ref.translation()) *
         T_cur_ref.rotation_matrix() * reference.K().inverse();
}

/// Whether two views are far enough apart for epipolar geometry to mean something.
enum class Baseline : std::uint8_t { sufficient, degenerate };

/// Judges by the median image motion that is left when the rotation's part, K R K^-1 x, is taken away:
/// where hardly anything is left, any F fits and the epipolar check says nothing.
/// @param min_parallax_px  smallest sufficient median [px]
template <std::floating_point S>
[[nodiscard]] Baseline baseline_verdict(std::span<const Eigen::Matrix<S, 2, 1>> x,
                                        std::span<const Eigen::Matrix<S, 2, 1>> x_m, const Pinhole<S>& camera,
                                        const SO3<S>& R_cur_ref, S min_parallax_px) {
  std::vector<S> parallax;
  parallax.reserve(x.size());
  for (std::size_t i = 0; i < std::min(x.size(), x_m.size()); ++i) {
    const auto rotated = camera.project(R_cur_ref * camera.ray(x[i]));
    if (rotated) parallax.push_back((*rotated - x_m[i]).norm());
  }
  if (parallax.empty()) return Baseline::degenerate;
  const auto middle = parallax.begin() + static_cast<std::ptrdiff_t>(parallax.size() / 2);
  std::nth_element(parallax.begin(), middle, parallax.end());
  return *middle >= min_parallax_px ? Baseline::sufficient : Baseline::degenerate;
}

/// Normalised eight-point algorithm: F of rank 2 with unit norm and x_m^T F x = 0 (Eq 8), least
/// squares where there are more than eight. `index` selects matches; empty: all. Solved in double for any
/// scalar, because the normal equations square the condition of the matches.
/// @return nullopt with fewer than 8 matches or when they leave more than one F (coincident points,
///         pure rotation of exact data)
template <std::floating_point S>
[[nodiscard]] std::optional<Eigen::Matrix<S, 3, 3>> fundamental_eight_point(
    std::span<const Eigen::Matrix<S, 2, 1>> x, std::span<const Eigen::Matrix<S, 2, 1>> x_m,
    std::span<const int> index = {}) {
  using W = std::common_type_t<S, double>;
  using Matrix3 = Eigen::Matrix<W, 3, 3>;
  using Matrix9 = Eigen::Matrix<W, 9, 9>;
  const std::size_t n = index.empty() ? std::min(x.size(), x_m.size()) : index.size();
  if (n < 8) return std::nullopt;
  const auto at = [&](std::size_t k) { return index.empty() ? k : static_cast<std::size_t>(index[k]); };
  Matrix3 T, T_m;
  const auto first = [&](std::size_t k) -> Eigen::Matrix<W, 2, 1> { return x[at(k)].template cast<W>(); };
  const auto second = [&](std::size_t k) -> Eigen::Matrix<W, 2, 1> { return x_m[at(k)].template cast<W>(); };
  if (!detail::normalising_transform<W>(n, first, T) || !detail::normalising_transform<W>(n, second, T_m)) {
    return std::nullopt;
  }
  Matrix9 AtA = Matrix9::Zero();
  for (std::size_t k = 0; k < n; ++k) {
    const Eigen::Matrix<W, 3, 1> p = T * first(k).homogeneous(), q = T_m * second(k).homogeneous();
    Eigen::Matrix<W, 9, 1> a;
    a << q.x() * p, q.y() * p, p;
    AtA.template selfadjointView<Eigen::Lower>().rankUpdate(a);
  }
  const Eigen::SelfAdjointEigenSolver<Matrix9> eigen(AtA);
  if (eigen.info() != Eigen::Success) return std::nullopt;
  // The second smallest eigenvalue must stand clear of rounding, or the null space is a plane.
  if (!(eigen.eigenvalues()(1) > W(1e3) * Eigen::NumTraits<W>::epsilon() * eigen.eigenvalues()(8)))
    return std::nullopt;
  const Eigen::Matrix<W, 9, 1> f = eigen.eigenvectors().col(0);
  Matrix3 F;
  F << f(0), f(1), f(2), f(3), f(4), f(5), f(6), f(7), f(8);
  Eigen::JacobiSVD<Matrix3> svd(F, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix<W, 3, 1> d = svd.singularValues();
  d.z() = W(0);
  F = T_m.transpose() * (svd.matrixU() * d.asDiagonal() * svd.matrixV().transpose()) * T;
  const W norm = F.norm();
  if (!(norm > W(0)) || !std::isfinite(norm)) return std::nullopt;
  return (F / norm).template cast<S>();
}

/// Options of fundamental_ransac; the threshold is of Sampson's distance.
template <std::floating_point S>
using FundamentalRansacOptions = RansacOptions<S>;

enum class FundamentalStatus : std::uint8_t { ok, too_few_points, no_consensus };

template <std::floating_point S>
struct FundamentalResult {
  Eigen::Matrix<S, 3, 3> F = Eigen::Matrix<S, 3, 3>::Zero();
  std::vector<std::uint8_t> inlier;  ///< one flag per match
  int inliers = 0;
  int iterations = 0;
  FundamentalStatus status = FundamentalStatus::too_few_points;
};

/// F by RANSAC over eight-point samples with an adaptive number of iterations, refined on its inliers.
template <std::floating_point S>
[[nodiscard]] FundamentalResult<S> fundamental_ransac(std::span<const Eigen::Matrix<S, 2, 1>> x,
                                                      std::span<const Eigen::Matrix<S, 2, 1>> x_m,
                                                      const RansacOptions<S>& options,
                                                      RansacWorkspace& workspace) {
  using Matrix3 = Eigen::Matrix<S, 3, 3>;
  const std::size_t n = std::min(x.size(), x_m.size());
  auto found = inlier_consensus<8, Matrix3>(
      n, options, [&](std::span<const int> index) { return fundamental_eight_point<S>(x, x_m, index); },
      [&](const Matrix3& F, std::size_t i) { return sampson_distance_squared<S>(F, x[i], x_m[i]); },
      workspace);
  FundamentalResult<S> result;
  result.inlier = std::move(found.inlier);
  result.inliers = found.inliers;
  result.iterations = found.iterations;
  if (found.model) {
    result.F = *found.model;
    result.status = FundamentalStatus::ok;
  } else if (n >= 8 && static_cast<int>(n) >= options.min_inliers) {
    result.status = FundamentalStatus::no_consensus;
  }
  return result;
}

/// The same with its own memory.
template <std::floating_point S>
[[nodiscard]] FundamentalResult<S> fundamental_ransac(std::span<const Eigen::Matrix<S, 2, 1>> x,
                                                      std::span<const Eigen::Matrix<S, 2, 1>> x_m,
                                                      const RansacOptions<S>& options) {
  RansacWorkspace workspace;
  return fundamental_ransac<S>(x, x_m, options, workspace);
}

}  // namespace dynslam
