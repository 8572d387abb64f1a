// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/geometry/detail/normalised_matches.hpp"
#include "dynslam/geometry/epipolar_distance.hpp"
#include "dynslam/geometry/fundamental_search.hpp"
#include "dynslam/geometry/hartley.hpp"
#include "dynslam/geometry/homography.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/robust/consensus.hpp"

namespace dynslam {

/// F of two calibrated views: K_cur^-T [t]x R K_ref^-1 with T_cur_ref = (R, t). Zero for t = 0.
template <Scalar S>
[[nodiscard]] Eigen::Matrix<S, 3, 3> fundamental_from_pose(const Pinhole<S>& reference,
                                                           const Pinhole<S>& current,
                                                           const SE3<S>& T_cur_ref) {
  using Matrix3 = Eigen::Matrix<S, 3, 3>;
  const Matrix3 K_inverse = reference.K().inverse(), K_cur_inverse = current.K().inverse();
  const Matrix3 left = detail::product<S>(K_cur_inverse.transpose(), SO3<S>::hat(T_cur_ref.translation()));
  return detail::product<S>(detail::product<S>(left, T_cur_ref.rotation_matrix()), K_inverse);
}

/// Whether two views are far enough apart for epipolar geometry to mean something.
enum class Baseline : std::uint8_t { sufficient, degenerate };

namespace detail {
/// @param parallax  of each match [px]; reordered
template <std::floating_point S>
[[nodiscard]] Baseline baseline_of(std::vector<S>& parallax, S min_parallax_px) {
  if (parallax.empty()) return Baseline::degenerate;
  const auto middle = parallax.begin() + static_cast<std::ptrdiff_t>(parallax.size() / 2);
  std::nth_element(parallax.begin(), middle, parallax.end());
  return *middle >= min_parallax_px ? Baseline::sufficient : Baseline::degenerate;
}
}  // namespace detail

/// Judges by the median image motion that is left when the rotation's part is taken away: where hardly
/// anything is left, any F fits and the epipolar check says nothing. Matches that are not finite, or that the
/// camera would not see after the rotation, are left out.
/// @param x, x_m  recorded pixels of the camera, which may have any lens
/// @param min_parallax_px  smallest sufficient median [recorded px]
template <std::floating_point S, CameraOf<S> C>
[[nodiscard]] Baseline baseline_verdict(std::span<const Eigen::Matrix<S, 2, 1>> x,
                                        std::span<const Eigen::Matrix<S, 2, 1>> x_m, const C& camera,
                                        const SO3<S>& R_cur_ref, S min_parallax_px) {
  std::vector<S> parallax;
  parallax.reserve(x.size());
  for (std::size_t i = 0; i < std::min(x.size(), x_m.size()); ++i) {
    const auto p = camera.unproject(x[i], S(1));
    if (!p) continue;
    const auto rotated = camera.project(R_cur_ref * *p);
    if (!rotated) continue;
    const S motion = (*rotated - x_m[i]).norm();
    if (std::isfinite(motion)) parallax.push_back(motion);
  }
  return detail::baseline_of(parallax, min_parallax_px);
}

/// Normalised eight-point algorithm: F of rank 2 with unit norm and x_m^T F x = 0 (Eq 8), least
/// squares where there are more than eight. `index` selects matches; empty: all; those that are not finite
/// are left out. Solved in double or better for any scalar, because the normal equations square the condition
/// of the matches.
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
  const auto at = [&](std::size_t k) { return index.empty() ? k : static_cast<std::size_t>(index[k]); };
  const auto first = [&](std::size_t k) -> Eigen::Matrix<W, 2, 1> { return x[at(k)].template cast<W>(); };
  const auto second = [&](std::size_t k) -> Eigen::Matrix<W, 2, 1> { return x_m[at(k)].template cast<W>(); };
  const auto used = [&](std::size_t k) {
    const Eigen::Matrix<W, 2, 1> a = first(k), b = second(k);
    return std::isfinite(a[0]) && std::isfinite(a[1]) && std::isfinite(b[0]) && std::isfinite(b[1]);
  };
  Matrix3 T, T_m;
  if (detail::normalising_transform<W>(n, first, used, T) < 8 ||
      detail::normalising_transform<W>(n, second, used, T_m) < 8)
    return std::nullopt;
  Matrix9 AtA = Matrix9::Zero();
  for (std::size_t k = 0; k < n; ++k) {
    if (!used(k)) continue;
    const Eigen::Matrix<W, 3, 1> p = detail::normalised<W>(T, first(k)),
                                 q = detail::normalised<W>(T_m, second(k));
    const W a[9] = {q[0] * p[0], q[0] * p[1], q[0] * p[2], q[1] * p[0], q[1] * p[1],
                    q[1] * p[2], p[0],        p[1],        p[2]};
    detail::add_square(a, AtA);
  }
  const Eigen::SelfAdjointEigenSolver<Matrix9> eigen(AtA);
  if (eigen.info() != Eigen::Success) return std::nullopt;
  // The second smallest eigenvalue must stand clear of rounding, or the null space is a plane.
  if (!(eigen.eigenvalues()(1) > W(1e3) * Eigen::NumTraits<W>::epsilon() * eigen.eigenvalues()(8)))
    return std::nullopt;
  const Eigen::Matrix<W, 9, 1> f = eigen.eigenvectors().col(0);
  Matrix3 F = detail::as_matrix(f);
  Eigen::JacobiSVD<Matrix3> svd(F, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix<W, 3, 1> d = svd.singularValues();
  d.z() = W(0);
  Matrix3 U = svd.matrixU();
  for (int c = 0; c < 3; ++c) {
    for (int r = 0; r < 3; ++r) U(r, c) *= d[c];
  }
  const Matrix3 V_T = svd.matrixV().transpose(), rank2 = detail::product<W>(U, V_T);
  F = detail::product<W>(detail::product<W>(T_m.transpose(), rank2), T);
  const W norm = F.norm();
  if (!(norm > W(0)) || !std::isfinite(norm)) return std::nullopt;
  F /= norm;
  return F.template cast<S>();
}

/// Options of fundamental_ransac; the threshold is of Sampson's distance.
template <std::floating_point S>
using FundamentalRansacOptions = RansacOptions<S>;

/// How fundamental_ransac ended.
enum class FundamentalStatus : std::uint8_t { ok, too_few_points, no_consensus };

/// What fundamental_ransac found.
template <std::floating_point S>
struct FundamentalResult {
  Eigen::Matrix<S, 3, 3> F = Eigen::Matrix<S, 3, 3>::Zero();
  std::vector<std::uint8_t> inlier;  ///< one flag per match
  int inliers = 0;
  int iterations = 0;
  FundamentalStatus status = FundamentalStatus::too_few_points;
};

/// F by RANSAC over seven-point samples with an adaptive number of iterations, refined on its inliers by
/// Sampson's distance. Solved in double and compared in float for any scalar; the flags are of scalar S.
/// Matches that are not finite are outliers.
/// @param x, x_m  ideal pixels (behind a lens: the overload of rays, ray_consensus.hpp)
/// @return too_few_points also where too few are finite
template <std::floating_point S>
[[nodiscard]] FundamentalResult<S> fundamental_ransac(std::span<const Eigen::Matrix<S, 2, 1>> x,
                                                      std::span<const Eigen::Matrix<S, 2, 1>> x_m,
                                                      const RansacOptions<S>& options,
                                                      RansacWorkspace& workspace) {
  const std::size_t n = std::min(x.size(), x_m.size());
  FundamentalResult<S> result;
  result.inlier.assign(n, 0);
  const std::size_t least = detail::least_matches(8, options);
  const auto finite = [&](std::size_t i) { return x[i].allFinite() && x_m[i].allFinite(); };
  std::size_t usable = 0;
  for (std::size_t i = 0; i < n; ++i) usable += finite(i) ? 1U : 0U;
  if (usable < least) return result;
  result.status = FundamentalStatus::no_consensus;
  detail::NormalisedMatches matches;
  if (!matches.set<S>(x, x_m, n, least, workspace)) return result;
  const double threshold = matches.scale() * static_cast<double>(options.threshold_px);
  detail::FundamentalSearch<double> search(matches, threshold * threshold);
  detail::HomographySearch<double> planes(matches, threshold * threshold);
  detail::BestModel best(search, options.refinements);
  result.iterations = detail::sample_fundamentals(matches, options, search, planes, best, workspace.index);
  if (best.inliers() == 0) return result;
  Eigen::Matrix3d F = matches.T_m().transpose() * best.model() * matches.T();
  F /= F.norm();
  result.F = F.cast<S>();
  const S limit = options.threshold_px * options.threshold_px;
  for (std::size_t i = 0; i < n; ++i) {
    result.inlier[i] = sampson_distance_squared<S>(result.F, x[i], x_m[i]) <= limit ? 1 : 0;
    result.inliers += result.inlier[i];
  }
  if (result.inliers >= options.min_inliers) result.status = FundamentalStatus::ok;
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

#include "dynslam/pop_macros.hpp"
