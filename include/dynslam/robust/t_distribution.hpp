// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "dynslam/concepts/robust.hpp"

namespace dynslam {

/// Student's t as a robust loss of the squared normalised residual s (Eqs 4 and 7).
///
///     weight(s) = numerator / (nu + s),     rho(s) = numerator * log(1 + s / nu),
///
/// so weight = d rho / d s and, with numerator = nu + d, weight averages to about one over
/// d-dimensional t-distributed residuals. The paper prints nu = 11 and nu + 1 also for its
/// 3-vector; Kerl et al. (2013), whom it follows, use nu = 5, and the likelihood of a d-vector gives
/// nu + d. The numerator only rescales the weights, and with them the threshold tau. It has to be named:
///
///     with_dimension(5, 1)      nu + 1: scalar residuals (Eq 4), and the default of the pose estimators,
///     whose
///                               residuals have two or three components
///     with_dimension(5, d)      nu + d: d-vectors (Eq 7)
///     paper()                   12 / (11 + s): as printed
template <Scalar S>
struct TDistribution {
  S nu;
  S numerator;

  /// The likelihood's numerator, nu + d, for residuals of `dimension` components.
  [[nodiscard]] static constexpr TDistribution with_dimension(S degrees, int dimension) {
    return TDistribution(degrees, degrees + S(dimension));
  }
  /// Any numerator.
  [[nodiscard]] static constexpr TDistribution with_numerator(S degrees, S explicit_numerator) {
    return TDistribution(degrees, explicit_numerator);
  }
  /// As printed in the paper: nu = 11 and numerator nu + 1 = 12, whatever the dimension.
  [[nodiscard]] static constexpr TDistribution paper() { return TDistribution(S(11), S(12)); }

  [[nodiscard]] S weight(const S& s) const { return numerator / (nu + s); }
  [[nodiscard]] S rho(const S& s) const {
    using std::log;
    return numerator * log(S(1) + s / nu);
  }

 private:
  constexpr TDistribution(S degrees, S explicit_numerator) : nu(degrees), numerator(explicit_numerator) {}
};

static_assert(RobustKernel<TDistribution<float>, float> && RobustKernel<TDistribution<double>, double>);

/// Options of the scale estimate.
template <std::floating_point S>
struct ScaleOptions {
  S nu = S(5);
  int max_iterations = 50;
  S tolerance = S(1e-4);  ///< relative change of sigma that ends the iteration
  S gross = S(6);         ///< residuals beyond so many robust standard deviations are left out; 0: none
  /// Smallest sigma, in the residuals' unit: what the measurement can tell apart (of synthetic or saturated
  /// data most residuals are exactly 0, and nothing can be weighed by a scale of 0). The default only keeps
  /// it above 0; give a grey value, a fraction of a pixel, the sensor's depth step.
  S floor = std::numeric_limits<S>::min();
};

/// Memory of estimate_scale; keep it between calls to avoid allocation.
template <std::floating_point S>
struct ScaleWorkspace {
  std::vector<S> magnitudes;
};

/// Scale of t-distributed, zero-mean residuals by the fixed point
/// sigma^2 = 1/n sum (nu + 1) / (nu + r^2 / sigma^2) r^2 (Kerl et al. 2013, below Eq 4),
/// started from the median absolute deviation. The fixed point alone breaks down at a share of
/// 1 / (nu + 1) outliers (17 % for nu = 5), and moving points may be more than that: residuals beyond
/// `gross` times the robust start are therefore left out, which keeps it near the truth up to 40 %.
/// Residuals times a power of two have a scale times that power, as far as numbers go in both directions.
/// @param residuals  any order; non-finite ones are ignored
/// @param excluded   empty, or one flag per residual: nonzero ones are left out (points on a mask)
/// @return sigma in the residuals' unit, at least `floor`, which is also the answer where more than half of
///         them are exactly zero; nullopt with fewer than 3 usable residuals
template <std::floating_point S>
[[nodiscard]] std::optional<S> estimate_scale(std::span<const S> residuals,
                                              std::span<const std::uint8_t> excluded,
                                              const ScaleOptions<S>& options, ScaleWorkspace<S>& workspace) {
  auto& r = workspace.magnitudes;
  r.clear();
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    if (!excluded.empty() && excluded[i] != 0) continue;
    if (std::isfinite(residuals[i])) r.push_back(std::abs(residuals[i]));
  }
  if (r.size() < 3) return std::nullopt;
  const auto middle = r.begin() + static_cast<std::ptrdiff_t>(r.size() / 2);
  std::nth_element(r.begin(), middle, r.end());
  if (!(*middle > S(0))) return options.floor;
  // In units of about the median, so that squares neither vanish nor overflow; a power of two rounds nothing.
  // A residual beyond kMost of them weighs nothing whatever its size.
  const S unit = std::ldexp(S(1), std::ilogb(*middle));
  constexpr S kMost = S(std::uint64_t(1) << 50U);
  constexpr S kNormalConsistency = S(1.4826);  // of the median absolute deviation
  S sigma = kNormalConsistency * (*middle / unit);
  for (S& a : r) a = std::min(a / unit, kMost);
  if (options.gross > S(0)) {
    const S limit = options.gross * sigma;
    r.erase(std::remove_if(r.begin(), r.end(), [limit](S a) { return a > limit; }), r.end());
  }
  for (int i = 0; i < options.max_iterations; ++i) {
    const S inverse = S(1) / (sigma * sigma);
    S sum = S(0);
    for (const S a : r) sum += (options.nu + S(1)) / (options.nu + a * a * inverse) * a * a;
    const S next = std::sqrt(sum / static_cast<S>(r.size()));
    const bool done = std::abs(next - sigma) <= options.tolerance * sigma;
    sigma = next;
    if (done || !(sigma > S(0))) break;
  }
  return std::max(sigma * unit, options.floor);
}

/// The same for all residuals, with the defaults and its own memory.
template <std::floating_point S>
[[nodiscard]] std::optional<S> estimate_scale(std::span<const S> residuals, S nu) {
  ScaleWorkspace<S> workspace;
  ScaleOptions<S> options;
  options.nu = nu;
  return estimate_scale<S>(residuals, {}, options, workspace);
}

/// Joint covariance of t-distributed D-vectors (zero mean) by the fixed point
/// Sigma = 1/n sum (nu + D) / (nu + r^T Sigma^-1 r) r r^T.
/// @param residuals  those with NaN or infinity in them are ignored
/// @param initial    start, positive definite; its scale does not matter
/// @param tolerance  change of an entry that ends the iteration, as a share of its components' deviations
/// @return nullopt with fewer than 2 D usable residuals or when Sigma becomes singular
template <std::floating_point S, int D>
[[nodiscard]] std::optional<Eigen::Matrix<S, D, D>> estimate_covariance(
    std::span<const Eigen::Matrix<S, D, 1>> residuals, const Eigen::Matrix<S, D, D>& initial, S nu,
    int max_iterations = 50, S tolerance = S(1e-4)) {
  using Matrix = Eigen::Matrix<S, D, D>;
  using Vector = Eigen::Matrix<S, D, 1>;
  // Cholesky factors have the residuals' unit: they are numbers where a determinant has vanished long since.
  Eigen::LLT<Matrix> factor;
  const auto factorise = [&factor](const Matrix& sigma) {
    factor.compute(sigma);
    return factor.info() == Eigen::Success && factor.matrixLLT().allFinite();
  };
  const auto whitened = [&factor](const Vector& r) -> Vector { return factor.matrixL().solve(r); };
  if (!factorise(initial)) return std::nullopt;
  std::size_t n = 0;
  S largest = S(1);
  for (const Vector& r : residuals) {
    if (!r.allFinite()) continue;
    ++n;
    largest = std::max(largest, whitened(r).stableNorm());
  }
  if (n < 2 * static_cast<std::size_t>(D)) return std::nullopt;
  // From above the first step lands near the solution; from far below each one gains a factor only.
  Matrix sigma = initial * largest * largest;
  for (int i = 0; i < max_iterations; ++i) {
    if (!factorise(sigma)) return std::nullopt;
    Matrix next = Matrix::Zero();
    for (const Vector& r : residuals) {
      if (!r.allFinite()) continue;
      const S weight = (nu + S(D)) / (nu + whitened(r).squaredNorm()) / static_cast<S>(n);
      next += (weight * r) * r.transpose();
    }
    const Vector deviations = next.diagonal().cwiseSqrt();
    const Matrix allowed = tolerance * deviations * deviations.transpose();
    const bool done = ((next - sigma).array().abs() <= allowed.array()).all();
    sigma = next;
    if (done) break;
  }
  return sigma;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
