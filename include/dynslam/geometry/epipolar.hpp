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

#include "dynslam/geometry/hartley.hpp"
#include "dynslam/geometry/homography.hpp"
#include "dynslam/geometry/minimal_models.hpp"
#include "dynslam/geometry/normalised_matches.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/robust/consensus.hpp"

namespace dynslam {

namespace detail {
/// F [x; 1].
template <Scalar S>
[[nodiscard]] Eigen::Matrix<S, 3, 1> line_of(const Eigen::Matrix<S, 3, 3>& F,
                                             const Eigen::Matrix<S, 2, 1>& x) {
  return {F(0, 0) * x[0] + F(0, 1) * x[1] + F(0, 2), F(1, 0) * x[0] + F(1, 1) * x[1] + F(1, 2),
          F(2, 0) * x[0] + F(2, 1) * x[1] + F(2, 2)};
}
}  // namespace detail

/// Epipolar line F x in the second image, scaled so that (a, b) is a unit vector: a u + b v + c is a
/// signed distance in pixels. A point at the epipole has no line: the zero vector.
template <Scalar S>
[[nodiscard]] Eigen::Matrix<S, 3, 1> epipolar_line(const Eigen::Matrix<S, 3, 3>& F,
                                                   const std::type_identity_t<Eigen::Matrix<S, 2, 1>>& x) {
  using std::sqrt;
  const Eigen::Matrix<S, 3, 1> line = detail::line_of<S>(F, x);
  const S a = line[0], b = line[1], c = line[2];
  const S norm = sqrt(a * a + b * b);
  if (!(S(0) < norm)) return {S(0), S(0), S(0)};
  return {a / norm, b / norm, c / norm};
}

/// Distance of the match x_m to the epipolar line of x [px] (Eq 8 as a distance).
template <Scalar S>
[[nodiscard]] S line_distance(const Eigen::Matrix<S, 3, 3>& F,
                              const std::type_identity_t<Eigen::Matrix<S, 2, 1>>& x,
                              const std::type_identity_t<Eigen::Matrix<S, 2, 1>>& x_m) {
  using std::abs;
  const Eigen::Matrix<S, 3, 1> line = epipolar_line<S>(F, x);
  return abs(line[0] * x_m[0] + line[1] * x_m[1] + line[2]);
}

/// Sampson's first-order geometric error, squared [px^2]; infinite where its gradient vanishes.
template <Scalar S>
[[nodiscard]] S sampson_distance_squared(const Eigen::Matrix<S, 3, 3>& F,
                                         const std::type_identity_t<Eigen::Matrix<S, 2, 1>>& x,
                                         const std::type_identity_t<Eigen::Matrix<S, 2, 1>>& x_m) {
  const Eigen::Matrix<S, 3, 1> line = detail::line_of<S>(F, x);
  const S a = line[0], b = line[1], c = line[2];
  const S a_m = F(0, 0) * x_m[0] + F(1, 0) * x_m[1] + F(2, 0),
          b_m = F(0, 1) * x_m[0] + F(1, 1) * x_m[1] + F(2, 1);
  const S e = x_m[0] * a + x_m[1] * b + c;
  const S gradient = a * a + b * b + a_m * a_m + b_m * b_m;
  if (!(S(0) < gradient)) return std::numeric_limits<S>::infinity();
  return e * e / gradient;
}

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

namespace detail {
/// Sampson's distance in matches' normalised coordinates as F changes, for fundamental_ransac.
template <std::same_as<double> W>  // of a template nothing is compiled where it is not used
class FundamentalSearch {
  struct Parts {
    float e2, g;
  };
  [[nodiscard]] static auto sampson(const Eigen::Matrix<W, 3, 3>& F) {
    const Eigen::Matrix<float, 3, 3> f = F.template cast<float>();
    const float f00 = f(0, 0), f01 = f(0, 1), f02 = f(0, 2), f10 = f(1, 0), f11 = f(1, 1), f12 = f(1, 2),
                f20 = f(2, 0), f21 = f(2, 1), f22 = f(2, 2);
    return [=](float x, float y, float x_m, float y_m) {
      const float a = f00 * x + f01 * y + f02, b = f10 * x + f11 * y + f12, c = f20 * x + f21 * y + f22;
      const float d = f00 * x_m + f10 * y_m + f20, g = f01 * x_m + f11 * y_m + f21;
      const float e = a * x_m + b * y_m + c;
      return Parts{e * e, a * a + b * b + d * d + g * g};
    };
  }

 public:
  FundamentalSearch(const NormalisedMatches& matches, double limit) : matches_(matches), limit_(limit) {}

  /// Sum of inlier_worth, d^2 being e^2 / |gradient|^2.
  [[nodiscard]] float score(const Eigen::Matrix<W, 3, 3>& F, float beaten) const {
    const auto distance = sampson(F);
    const float inverse = static_cast<float>(1 / limit_);
    return matches_.sum(beaten, [=](float x, float y, float x_m, float y_m) {
      const auto [e2, g] = distance(x, y, x_m, y_m);
      return inlier_worth(e2 * inverse / (g + 1e-30F));
    });
  }
  /// Matches within the limit.
  [[nodiscard]] int inliers(const Eigen::Matrix<W, 3, 3>& F) const {
    const auto distance = sampson(F);
    const float limit = static_cast<float>(limit_);
    return static_cast<int>(matches_.sum(-1.0F, [=](float x, float y, float x_m, float y_m) {
      const auto [e2, g] = distance(x, y, x_m, y_m);
      return e2 <= limit * g ? 1.0F : 0.0F;
    }));
  }

  [[nodiscard]] bool near(const Eigen::Matrix<W, 3, 3>& F, std::size_t i) const {
    const Eigen::Vector3d p = matches_.first(i), q = matches_.second(i);
    return sampson_distance_squared<W>(F, {p[0], p[1]}, {q[0], q[1]}) <= limit_;
  }

  /// Least squares of Sampson's distances of the inliers of F: the eight-point equations, each weighed by its
  /// gradient at F, then the nearest matrix of rank 2.
  [[nodiscard]] std::optional<Eigen::Matrix<W, 3, 3>> refit(const Eigen::Matrix<W, 3, 3>& F, double wide) {
    const std::size_t n = matches_.size();
    const double f00 = F(0, 0), f01 = F(0, 1), f02 = F(0, 2), f10 = F(1, 0), f11 = F(1, 1), f12 = F(1, 2),
                 f20 = F(2, 0), f21 = F(2, 1), f22 = F(2, 2), far = wide * limit_;
    const double *x = matches_.fine(0), *y = matches_.fine(1), *x_m = matches_.fine(2),
                 *y_m = matches_.fine(3);
    weights_.resize(6 * n);
    double *w = weights_.data(), *w_x = w + n, *w_y = w_x + n, *w_xy = w_y + n, *w_xx = w_xy + n,
           *w_yy = w_xx + n;
    for (std::size_t i = 0; i < n; ++i) {
      const double a = f00 * x[i] + f01 * y[i] + f02, b = f10 * x[i] + f11 * y[i] + f12;
      const double e = a * x_m[i] + b * y_m[i] + (f20 * x[i] + f21 * y[i] + f22);
      const double c = f00 * x_m[i] + f10 * y_m[i] + f20, d = f01 * x_m[i] + f11 * y_m[i] + f21;
      const double gradient = a * a + b * b + c * c + d * d;
      w[i] = e * e <= far * gradient && gradient > 0 ? 1 / gradient : 0.0;
      w_x[i] = w[i] * x_m[i];
      w_y[i] = w[i] * y_m[i];
      w_xy[i] = w_x[i] * y_m[i];
      w_xx[i] = w_x[i] * x_m[i];
      w_yy[i] = w_y[i] * y_m[i];
    }
    Eigen::Matrix<W, 9, 9> A;
    const auto fill = [&](Eigen::Index i, Eigen::Index j, const double* weights) {
      const Eigen::Matrix<W, 3, 3> m = matches_.moments(weights);
      put_block(A, i, j, m);
      put_block(A, j, i, m);
    };
    fill(2, 2, w);
    fill(0, 2, w_x);
    fill(1, 2, w_y);
    fill(0, 1, w_xy);
    fill(0, 0, w_xx);
    fill(1, 1, w_yy);
    const auto f = smallest_eigenvector(A, as_vector(F));
    if (!f) return std::nullopt;
    // Without the direction that it maps to the least: the eigenvector of F^T F with the smallest eigenvalue.
    const Eigen::Matrix<W, 3, 3> m = as_matrix(*f);
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix<W, 3, 3>> eigen;
    eigen.computeDirect(m.transpose() * m);
    const Eigen::Matrix<W, 3, 1> null = eigen.eigenvectors().col(0), m_null = product<W>(m, null);
    Eigen::Matrix<W, 3, 3> rank2;
    for (int c = 0; c < 3; ++c) {
      for (int r = 0; r < 3; ++r) rank2(r, c) = m(r, c) - m_null[r] * null[c];
    }
    rank2 /= rank2.norm();
    return rank2.allFinite() ? std::optional<Eigen::Matrix<W, 3, 3>>(rank2) : std::nullopt;
  }

 private:
  const NormalisedMatches& matches_;
  double limit_;
  std::vector<double> weights_;
};
}  // namespace detail

namespace detail {
/// Where most inliers of F are on a plane its sample mostly was, too, and any F of that plane's pencil was
/// taken. The one of the scene is H and two matches off the plane: [e]x H, e being where their lines cross
/// (DEGENSAC, Chum et al. 2005).
/// @param index  scratch
template <std::same_as<double> W>
void leave_plane(const NormalisedMatches& matches, W limit, std::uint64_t seed,
                 FundamentalSearch<W>& fundamental, BestModel<FundamentalSearch<W>>& best,
                 std::vector<int>& index) {
  constexpr int kPlanes = 20, kPairs = 50;
  const auto list = [&](const auto& belongs) {
    index.clear();
    for (std::size_t i = 0; i < matches.size(); ++i) {
      if (belongs(i)) index.push_back(static_cast<int>(i));
    }
  };
  SplitMix64 random(seed);
  const auto draw = [&](auto& sample) {
    draw_distinct(random, index.size(), sample);
    for (std::size_t& k : sample) k = static_cast<std::size_t>(index[k]);
  };
  HomographySearch<W> planes(matches, limit);
  BestModel plane(planes, 3);
  list([&](std::size_t i) { return fundamental.near(best.model(), i); });
  if (index.size() < 8) return;
  for (int k = 0; k < kPlanes && 10 * plane.inliers() < 9 * best.inliers(); ++k) {
    std::array<std::size_t, 4> sample{};
    draw(sample);
    Eigen::Matrix<W, 3, 4> p, q;
    for (std::size_t j = 0; j < 4; ++j) matches.copy_points(sample[j], p.data() + 3 * j, q.data() + 3 * j);
    if (const auto H = homography_four_point(p, q)) plane.consider(*H, 4);
  }
  if (2 * plane.inliers() < best.inliers()) return;
  const Eigen::Matrix<W, 3, 3> H = plane.model();
  list([&](std::size_t i) { return !planes.near(H, i); });
  if (index.size() < 2) return;
  for (int k = 0; k < kPairs; ++k) {
    std::array<std::size_t, 2> pair{};
    draw(pair);
    const auto line = [&](std::size_t i) {
      return Eigen::Matrix<W, 3, 1>(product<W>(H, matches.first(i)).cross(matches.second(i)));
    };
    const Eigen::Matrix<W, 3, 1> e = line(pair[0]).cross(line(pair[1]));
    const Eigen::Matrix<W, 3, 3> F = product<W>(SO3<W>::hat(e), H);
    const W norm = F.norm();
    if (norm > 0 && std::isfinite(norm)) best.consider(F / norm, 7);
  }
}
}  // namespace detail

/// F by RANSAC over seven-point samples with an adaptive number of iterations, refined on its inliers by
/// Sampson's distance. Solved in double and compared in float for any scalar; the flags are of scalar S.
template <std::floating_point S>
[[nodiscard]] FundamentalResult<S> fundamental_ransac(std::span<const Eigen::Matrix<S, 2, 1>> x,
                                                      std::span<const Eigen::Matrix<S, 2, 1>> x_m,
                                                      const RansacOptions<S>& options,
                                                      RansacWorkspace& workspace) {
  const std::size_t n = std::min(x.size(), x_m.size());
  FundamentalResult<S> result;
  result.inlier.assign(n, 0);
  if (n < std::max(std::size_t{8}, static_cast<std::size_t>(std::max(0, options.min_inliers)))) return result;
  result.status = FundamentalStatus::no_consensus;
  detail::NormalisedMatches matches;
  if (!matches.set<S>(x, x_m, n, workspace)) return result;
  const double threshold = matches.scale() * static_cast<double>(options.threshold_px);
  detail::FundamentalSearch<double> search(matches, threshold * threshold);
  detail::BestModel best(search, options.refinements);
  result.iterations = detail::search_models<7, S>(
      n, options, best, [&](const std::array<std::size_t, 7>& sample, const auto& consider) {
        Eigen::Matrix<double, 3, 7> p, q;
        for (std::size_t k = 0; k < 7; ++k)
          matches.copy_points(sample[k], p.data() + 3 * k, q.data() + 3 * k);
        std::array<Eigen::Matrix3d, 3> F;
        const int hypotheses = fundamental_seven_point(p, q, F);
        for (int k = 0; k < hypotheses; ++k) consider(F[static_cast<std::size_t>(k)]);
      });
  detail::leave_plane(matches, threshold * threshold, options.seed, search, best, workspace.index);
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
