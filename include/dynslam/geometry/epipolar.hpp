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
#include <vector>

#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/robust/split_mix64.hpp"

namespace dynslam {

/// Epipolar line F x in the second image, scaled so that (a, b) is a unit vector: a u + b v + c is a
/// signed distance in pixels. A point at the epipole has no line: the zero vector.
template <Scalar S>
[[nodiscard]] Eigen::Matrix<S, 3, 1> epipolar_line(const Eigen::Matrix<S, 3, 3>& F,
                                                   const Eigen::Matrix<S, 2, 1>& x) {
  using std::sqrt;
  const Eigen::Matrix<S, 3, 1> line = F * x.homogeneous();
  const S norm = sqrt(line.x() * line.x() + line.y() * line.y());
  if (!(S(0) < norm)) return Eigen::Matrix<S, 3, 1>::Zero();
  return line / norm;
}

/// Distance of the match x_m to the epipolar line of x [px] (Eq 8 as a distance).
template <Scalar S>
[[nodiscard]] S line_distance(const Eigen::Matrix<S, 3, 3>& F, const Eigen::Matrix<S, 2, 1>& x,
                              const Eigen::Matrix<S, 2, 1>& x_m) {
  using std::abs;
  return abs(epipolar_line<S>(F, x).dot(x_m.homogeneous()));
}

/// Sampson's first-order geometric error, squared [px^2]; infinite where its gradient vanishes.
template <Scalar S>
[[nodiscard]] S sampson_distance_squared(const Eigen::Matrix<S, 3, 3>& F, const Eigen::Matrix<S, 2, 1>& x,
                                         const Eigen::Matrix<S, 2, 1>& x_m) {
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

namespace detail {
/// Similarity that moves points to their centroid and their mean distance to sqrt(2) (Hartley 1997).
template <std::floating_point S, class Point>
[[nodiscard]] bool normalising_transform(std::size_t n, const Point& point, Eigen::Matrix<S, 3, 3>& T) {
  Eigen::Matrix<S, 2, 1> mean = Eigen::Matrix<S, 2, 1>::Zero();
  for (std::size_t i = 0; i < n; ++i) mean += point(i);
  mean /= static_cast<S>(n);
  S distance = S(0);
  for (std::size_t i = 0; i < n; ++i) distance += (point(i) - mean).norm();
  distance /= static_cast<S>(n);
  if (!(distance > S(0)) || !std::isfinite(distance)) return false;
  const S s = std::sqrt(S(2)) / distance;
  T << s, S(0), -s * mean.x(), S(0), s, -s * mean.y(), S(0), S(0), S(1);
  return true;
}
}  // namespace detail

/// Normalised eight-point algorithm: F of rank 2 with unit norm and x_m^T F x = 0 (Eq 8), least
/// squares where there are more than eight. `index` selects matches; empty: all.
/// @return nullopt with fewer than 8 matches or when they leave more than one F (coincident points,
///         pure rotation of exact data)
template <std::floating_point S>
[[nodiscard]] std::optional<Eigen::Matrix<S, 3, 3>> fundamental_eight_point(
    std::span<const Eigen::Matrix<S, 2, 1>> x, std::span<const Eigen::Matrix<S, 2, 1>> x_m,
    std::span<const int> index = {}) {
  using Matrix3 = Eigen::Matrix<S, 3, 3>;
  using Matrix9 = Eigen::Matrix<S, 9, 9>;
  const std::size_t n = index.empty() ? std::min(x.size(), x_m.size()) : index.size();
  if (n < 8) return std::nullopt;
  const auto at = [&](std::size_t k) { return index.empty() ? k : static_cast<std::size_t>(index[k]); };
  Matrix3 T, T_m;
  if (!detail::normalising_transform<S>(
          n, [&](std::size_t k) { return x[at(k)]; }, T) ||
      !detail::normalising_transform<S>(
          n, [&](std::size_t k) { return x_m[at(k)]; }, T_m)) {
    return std::nullopt;
  }
  Matrix9 AtA = Matrix9::Zero();
  for (std::size_t k = 0; k < n; ++k) {
    const Eigen::Matrix<S, 3, 1> p = T * x[at(k)].homogeneous(), q = T_m * x_m[at(k)].homogeneous();
    Eigen::Matrix<S, 9, 1> a;
    a << q.x() * p, q.y() * p, p;
    AtA.template selfadjointView<Eigen::Lower>().rankUpdate(a);
  }
  const Eigen::SelfAdjointEigenSolver<Matrix9> eigen(AtA);
  if (eigen.info() != Eigen::Success) return std::nullopt;
  // The second smallest eigenvalue must stand clear of rounding, or the null space is a plane.
  if (!(eigen.eigenvalues()(1) > S(1e3) * Eigen::NumTraits<S>::epsilon() * eigen.eigenvalues()(8)))
    return std::nullopt;
  const Eigen::Matrix<S, 9, 1> f = eigen.eigenvectors().col(0);
  Matrix3 F;
  F << f(0), f(1), f(2), f(3), f(4), f(5), f(6), f(7), f(8);
  Eigen::JacobiSVD<Matrix3> svd(F, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix<S, 3, 1> d = svd.singularValues();
  d.z() = S(0);
  F = T_m.transpose() * (svd.matrixU() * d.asDiagonal() * svd.matrixV().transpose()) * T;
  const S norm = F.norm();
  if (!(norm > S(0)) || !std::isfinite(norm)) return std::nullopt;
  return F / norm;
}

template <std::floating_point S>
struct FundamentalRansacOptions {
  S threshold_px = S(1);   ///< Sampson distance of an inlier [px]
  S confidence = S(0.99);  ///< of having drawn one clean sample
  int max_iterations = 300;
  int min_inliers = 16;
  std::uint64_t seed = 1;  ///< same seed and input: same result, on every platform
};

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
                                                      const FundamentalRansacOptions<S>& options) {
  constexpr int kSample = 8;
  FundamentalResult<S> result;
  const int n = static_cast<int>(std::min(x.size(), x_m.size()));
  result.inlier.assign(static_cast<std::size_t>(n), 0);
  if (n < std::max(kSample, options.min_inliers)) return result;
  const S limit = options.threshold_px * options.threshold_px;
  const auto score = [&](const Eigen::Matrix<S, 3, 3>& F, std::vector<std::uint8_t>& flags) {
    int inliers = 0;
    for (int i = 0; i < n; ++i) {
      const auto k = static_cast<std::size_t>(i);
      flags[k] = sampson_distance_squared<S>(F, x[k], x_m[k]) <= limit ? 1 : 0;
      inliers += flags[k];
    }
    return inliers;
  };
  SplitMix64 random(options.seed);
  std::vector<std::uint8_t> flags(static_cast<std::size_t>(n));
  int sample[kSample];
  int needed = options.max_iterations;
  for (; result.iterations < needed; ++result.iterations) {
    for (int k = 0; k < kSample; ++k) {
      do sample[k] = random.below(n);
      while (std::find(sample, sample + k, sample[k]) != sample + k);
    }
    const auto F = fundamental_eight_point<S>(x, x_m, std::span<const int>(sample, kSample));
    if (!F) continue;
    const int inliers = score(*F, flags);
    if (inliers <= result.inliers) continue;
    result.inliers = inliers;
    result.F = *F;
    result.inlier.swap(flags);
    const S share = static_cast<S>(inliers) / static_cast<S>(n);
    const S miss = std::log(S(1) - std::pow(share, S(kSample)));
    if (miss < S(0)) {
      needed = std::min(
          needed, static_cast<int>(std::min(S(1e6), std::ceil(std::log(S(1) - options.confidence) / miss))));
    }
  }
  if (result.inliers < options.min_inliers) {
    result.status = FundamentalStatus::no_consensus;
    return result;
  }
  for (int round = 0; round < 3; ++round) {  // least squares on the inliers, while that gains some
    std::vector<int> index;
    for (int i = 0; i < n; ++i) {
      if (result.inlier[static_cast<std::size_t>(i)] != 0) index.push_back(i);
    }
    const auto F = fundamental_eight_point<S>(x, x_m, index);
    if (!F) break;
    const int inliers = score(*F, flags);
    if (inliers < result.inliers) break;
    const bool same = inliers == result.inliers;
    result.F = *F;
    result.inliers = inliers;
    result.inlier.swap(flags);
    if (same) break;
  }
  result.status = FundamentalStatus::ok;
  return result;
}

}  // namespace dynslam
