// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <limits>
#include <optional>
#include <span>
#include <type_traits>
#include <vector>

#include "dynslam/concepts/scalar.hpp"
#include "dynslam/geometry/detail/best_model.hpp"
#include "dynslam/geometry/detail/normalised_matches.hpp"
#include "dynslam/geometry/hartley.hpp"
#include "dynslam/geometry/minimal_models.hpp"
#include "dynslam/robust/consensus.hpp"

namespace dynslam {

/// H x in pixels; nullopt at infinity and beyond.
template <Scalar S>
[[nodiscard]] std::optional<Eigen::Matrix<S, 2, 1>> transfer(
    const Eigen::Matrix<S, 3, 3>& H, const std::type_identity_t<Eigen::Matrix<S, 2, 1>>& x) {
  const S z = H(2, 0) * x[0] + H(2, 1) * x[1] + H(2, 2);
  if (!(S(1e-12) < z)) return std::nullopt;
  return Eigen::Matrix<S, 2, 1>((H(0, 0) * x[0] + H(0, 1) * x[1] + H(0, 2)) / z,
                                (H(1, 0) * x[0] + H(1, 1) * x[1] + H(1, 2)) / z);
}

/// Transfer error |H x - x_m|^2 [px^2]; infinite where H x is at infinity.
template <Scalar S>
[[nodiscard]] S transfer_distance_squared(const Eigen::Matrix<S, 3, 3>& H,
                                          const std::type_identity_t<Eigen::Matrix<S, 2, 1>>& x,
                                          const std::type_identity_t<Eigen::Matrix<S, 2, 1>>& x_m) {
  const auto there = transfer<S>(H, x);
  if (!there) return S(std::numeric_limits<double>::infinity());
  const S du = (*there)[0] - x_m[0], dv = (*there)[1] - x_m[1];
  return du * du + dv * dv;
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
/// double or better for any scalar. Matches that are not finite are left out.
/// @return nullopt with fewer than 4 matches or when they leave more than one H (three on a line of four)
template <std::floating_point S>
[[nodiscard]] std::optional<Eigen::Matrix<S, 3, 3>> homography_dlt(
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
  if (detail::normalising_transform<W>(n, first, used, T) < 4 ||
      detail::normalising_transform<W>(n, second, used, T_m) < 4)
    return std::nullopt;
  Matrix9 AtA = Matrix9::Zero();
  for (std::size_t k = 0; k < n; ++k) {
    if (!used(k)) continue;
    const Eigen::Matrix<W, 3, 1> p = detail::normalised<W>(T, first(k)),
                                 q = detail::normalised<W>(T_m, second(k));
    const W a[9] = {W(0), W(0), W(0), -p[0], -p[1], -p[2], q[1] * p[0], q[1] * p[1], q[1] * p[2]};
    const W b[9] = {p[0], p[1], p[2], W(0), W(0), W(0), -q[0] * p[0], -q[0] * p[1], -q[0] * p[2]};
    detail::add_square(a, AtA);
    detail::add_square(b, AtA);
  }
  const Eigen::SelfAdjointEigenSolver<Matrix9> eigen(AtA);
  if (eigen.info() != Eigen::Success) return std::nullopt;
  if (!(eigen.eigenvalues()(1) > W(1e3) * Eigen::NumTraits<W>::epsilon() * eigen.eigenvalues()(8)))
    return std::nullopt;
  const Eigen::Matrix<W, 9, 1> h = eigen.eigenvectors().col(0);
  const Matrix3 normalised = detail::as_matrix(h), T_m_inverse = T_m.inverse();
  Matrix3 H = detail::product<W>(detail::product<W>(T_m_inverse, normalised), T);
  const W norm = H.norm();
  if (!(norm > W(0)) || !std::isfinite(norm)) return std::nullopt;
  int in_front = 0;  // of the points; all or none, of matches that one view of a plane explains
  for (std::size_t k = 0; k < n; ++k) {
    if (!used(k)) continue;
    const Eigen::Matrix<W, 2, 1> p = first(k);
    in_front += H(2, 0) * p[0] + H(2, 1) * p[1] + H(2, 2) < W(0) ? -1 : 1;
  }
  const W sign = in_front < 0 ? W(-1) : W(1);
  H *= sign / norm;
  return H.template cast<S>();
}

namespace detail {
/// A transfer error has two components, and noise in both: for the same noise its square is this many times
/// Sampson's beyond which a match counts nothing.
inline constexpr double kTransferReach = 3;

/// Transfer errors in matches' normalised coordinates as H changes, for homography_ransac.
template <std::same_as<double> W>  // of a template nothing is compiled where it is not used
class HomographySearch {
  struct Parts {
    float d2, z;  // of the numerators
  };
  [[nodiscard]] static auto transfer_error(const Eigen::Matrix<W, 3, 3>& H) {
    const Eigen::Matrix<float, 3, 3> h = H.template cast<float>();
    const float h00 = h(0, 0), h01 = h(0, 1), h02 = h(0, 2), h10 = h(1, 0), h11 = h(1, 1), h12 = h(1, 2),
                h20 = h(2, 0), h21 = h(2, 1), h22 = h(2, 2);
    return [=](float x, float y, float x_m, float y_m) {
      const float z = h20 * x + h21 * y + h22;
      const float du = h00 * x + h01 * y + h02 - z * x_m, dv = h10 * x + h11 * y + h12 - z * y_m;
      return Parts{du * du + dv * dv, z};
    };
  }

 public:
  HomographySearch(const NormalisedMatches& matches, double limit) : matches_(matches), limit_(limit) {}

  /// Sum of inlier_worth, d^2 being |H x - x_m|^2, over the matches with H x in front.
  [[nodiscard]] float score(const Eigen::Matrix<W, 3, 3>& H, float beaten) const {
    const auto distance = transfer_error(H);
    const float inverse = static_cast<float>(1 / (kTransferReach * limit_));
    return matches_.sum(beaten, [=](float x, float y, float x_m, float y_m) {
      const auto [d2, z] = distance(x, y, x_m, y_m);
      // Nothing behind. Of a choice, g++ makes branches here and no vectors.
      const float in_front = 0.5F * (z + std::abs(z));
      return inlier_worth(d2 * inverse / (in_front * in_front + 1e-12F));
    });
  }
  /// Matches within the limit.
  [[nodiscard]] int inliers(const Eigen::Matrix<W, 3, 3>& H) const {
    const auto distance = transfer_error(H);
    const float limit = static_cast<float>(limit_);
    return static_cast<int>(matches_.sum(-1.0F, [=](float x, float y, float x_m, float y_m) {
      const auto [d2, z] = distance(x, y, x_m, y_m);
      return d2 <= limit * z * z && z > 0.0F ? 1.0F : 0.0F;
    }));
  }

  [[nodiscard]] std::size_t size() const { return matches_.size(); }
  [[nodiscard]] bool near(const Eigen::Matrix<W, 3, 3>& H, std::size_t i, double wide = 1) const {
    const Eigen::Vector3d p = matches_.first(i), q = matches_.second(i);
    return transfer_distance_squared<W>(H, {p[0], p[1]}, {q[0], q[1]}) <= wide * limit_;
  }

  /// Least squares of the transfer errors, robust (Tukey's biweight): the equations of the direct linear
  /// transform, each pair divided by the depth H x has.
  /// @param first  matches
  /// @param wide   of the squared threshold, from where a match counts nothing
  template <std::floating_point T>
  [[nodiscard]] std::optional<Eigen::Matrix<W, 3, 3>> step(const Eigen::Matrix<W, 3, 3>& H,
                                                           const FirstMatches& first, double wide) {
    const std::size_t n = first.size();
    const double h00 = H(0, 0), h01 = H(0, 1), h02 = H(0, 2), h10 = H(1, 0), h11 = H(1, 1), h12 = H(1, 2),
                 h20 = H(2, 0), h21 = H(2, 1), h22 = H(2, 2), far = wide * kTransferReach * limit_;
    const double *x = matches_.fine(0), *y = matches_.fine(1), *x_m = matches_.fine(2),
                 *y_m = matches_.fine(3);
    weights_.resize(4 * n);
    double *w = weights_.data(), *minus_w_x = w + n, *minus_w_y = minus_w_x + n, *w_square = minus_w_y + n;
    for (std::size_t i = 0; i < n; ++i) {
      const double z = h20 * x[i] + h21 * y[i] + h22, z2 = z * z;
      const double du = h00 * x[i] + h01 * y[i] + h02 - z * x_m[i],
                   dv = h10 * x[i] + h11 * y[i] + h12 - z * y_m[i];
      const double left = 1 - (du * du + dv * dv) / (far * z2);
      w[i] = left > 0 && z > 0 ? left * left / z2 : 0.0;
      minus_w_x[i] = -(w[i] * x_m[i]);
      minus_w_y[i] = -(w[i] * y_m[i]);
      w_square[i] = w[i] * (x_m[i] * x_m[i] + y_m[i] * y_m[i]);
    }
    Eigen::Matrix<W, 9, 9> A = Eigen::Matrix<W, 9, 9>::Zero();
    const Eigen::Matrix<W, 3, 3> of_w = matches_.moments(n, w), of_x = matches_.moments(n, minus_w_x),
                                 of_y = matches_.moments(n, minus_w_y);
    put_block(A, 0, 0, of_w);
    put_block(A, 1, 1, of_w);
    put_block(A, 0, 2, of_x);
    put_block(A, 2, 0, of_x);
    put_block(A, 1, 2, of_y);
    put_block(A, 2, 1, of_y);
    put_block(A, 2, 2, matches_.moments(n, w_square));
    const auto h = smallest_eigenvector(A, as_vector(H));
    if (!h) return std::nullopt;
    return as_matrix(*h);
  }

 private:
  const NormalisedMatches& matches_;
  double limit_;
  std::vector<double> weights_;
};
}  // namespace detail

namespace detail {
/// H by samples of four. @return iterations
template <std::floating_point S, class Matches, class Search>
int sample_homographies(const Matches& matches, const RansacOptions<S>& options, BestModel<Search>& best) {
  return search_models<4, S>(matches.size(), options, best,
                             [&](const std::array<std::size_t, 4>& sample, const auto& consider) {
                               Eigen::Matrix<double, 3, 4> p, q;
                               for (std::size_t k = 0; k < 4; ++k)
                                 matches.copy_points(sample[k], p.data() + 3 * k, q.data() + 3 * k);
                               if (const auto H = homography_four_point(p, q)) consider(*H);
                             });
}
/// Matches without which a RANSAC over samples of `sample` is not begun.
template <std::floating_point S>
[[nodiscard]] std::size_t least_matches(std::size_t sample, const RansacOptions<S>& options) {
  return std::max(sample, static_cast<std::size_t>(std::max(0, options.min_inliers)));
}
}  // namespace detail

/// H by RANSAC over samples of four, refined on its inliers, judged by the transfer error. Solved in double
/// and compared in float for any scalar; the flags are of scalar S. Matches that are not finite are outliers.
/// @param x, x_m  ideal pixels (behind a lens: the overload of rays, ray_consensus.hpp)
template <std::floating_point S>
[[nodiscard]] RansacOutcome<Eigen::Matrix<S, 3, 3>> homography_ransac(
    std::span<const Eigen::Matrix<S, 2, 1>> x, std::span<const Eigen::Matrix<S, 2, 1>> x_m,
    const RansacOptions<S>& options, RansacWorkspace& workspace) {
  const std::size_t n = std::min(x.size(), x_m.size());
  RansacOutcome<Eigen::Matrix<S, 3, 3>> result;
  result.inlier.assign(n, 0);
  detail::NormalisedMatches matches;
  if (!matches.set<S>(x, x_m, n, detail::least_matches(4, options), workspace)) return result;
  const double threshold = matches.scale() * static_cast<double>(options.threshold_px);
  detail::HomographySearch<double> search(matches, threshold * threshold);
  detail::BestModel best(search, options.refinements);
  result.iterations = detail::sample_homographies(matches, options, best);
  best.finish();
  if (best.inliers() == 0) return result;
  Eigen::Matrix3d H =
      detail::product<double>(detail::product<double>(matches.T_m_inverse(), best.model()), matches.T());
  H /= H.norm();
  result.model = H.cast<S>();
  const S limit = options.threshold_px * options.threshold_px;
  for (std::size_t i = 0; i < n; ++i) {
    result.inlier[i] = transfer_distance_squared<S>(*result.model, x[i], x_m[i]) <= limit ? 1 : 0;
    result.inliers += result.inlier[i];
  }
  if (result.inliers < options.min_inliers) result.model.reset();
  return result;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
