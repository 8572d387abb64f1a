// SPDX-License-Identifier: BSD-3-Clause
#pragma once

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
    return sampson_distance_squared<W>(F, matches_.first(i).head<2>(), matches_.second(i).head<2>()) <=
           limit_;
  }

  /// Least squares of Sampson's distances of the inliers of F: the eight-point equations, each weighed by its
  /// gradient at F, then the nearest matrix of rank 2.
  [[nodiscard]] std::optional<Eigen::Matrix<W, 3, 3>> refit(const Eigen::Matrix<W, 3, 3>& F, double wide) {
    const auto x = matches_.fine(0), y = matches_.fine(1), x_m = matches_.fine(2), y_m = matches_.fine(3);
    a_ = F(0, 0) * x + F(0, 1) * y + F(0, 2);
    b_ = F(1, 0) * x + F(1, 1) * y + F(1, 2);
    e_ = a_ * x_m + b_ * y_m + (F(2, 0) * x + F(2, 1) * y + F(2, 2));
    weight_ = a_.square() + b_.square() + (F(0, 0) * x_m + F(1, 0) * y_m + F(2, 0)).square() +
              (F(0, 1) * x_m + F(1, 1) * y_m + F(2, 1)).square();
    for (Eigen::Index i = 0; i < weight_.size(); ++i)
      weight_(i) = e_(i) * e_(i) <= wide * limit_ * weight_(i) && weight_(i) > 0 ? 1 / weight_(i) : 0.0;
    Eigen::Matrix<W, 9, 9> A;
    const auto fill = [&](Eigen::Index i, Eigen::Index j, const Eigen::ArrayX<W>& w) {
      A.template block<3, 3>(3 * i, 3 * j) = A.template block<3, 3>(3 * j, 3 * i) = matches_.moments(w);
    };
    fill(2, 2, weight_);
    fill(0, 2, a_ = weight_ * x_m);
    fill(1, 2, b_ = weight_ * y_m);
    fill(0, 1, e_ = a_ * y_m);
    fill(0, 0, a_ = a_ * x_m);
    fill(1, 1, b_ = b_ * y_m);
    const auto f = smallest_eigenvector(A, as_vector(F));
    if (!f) return std::nullopt;
    // Without the direction that it maps to the least: the eigenvector of F^T F with the smallest eigenvalue.
    const Eigen::Matrix<W, 3, 3> m = as_matrix(*f);
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix<W, 3, 3>> eigen;
    eigen.computeDirect(m.transpose() * m);
    const Eigen::Matrix<W, 3, 1> null = eigen.eigenvectors().col(0);
    Eigen::Matrix<W, 3, 3> rank2 = m - m * null * null.transpose();
    rank2 /= rank2.norm();
    return rank2.allFinite() ? std::optional<Eigen::Matrix<W, 3, 3>>(rank2) : std::nullopt;
  }

 private:
  const NormalisedMatches& matches_;
  double limit_;
  Eigen::ArrayX<W> a_, b_, e_, weight_;
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
    for (std::size_t j = 0; j < 4; ++j) {
      p.col(static_cast<Eigen::Index>(j)) = matches.first(sample[j]);
      q.col(static_cast<Eigen::Index>(j)) = matches.second(sample[j]);
    }
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
      return Eigen::Matrix<W, 3, 1>((H * matches.first(i)).cross(matches.second(i)));
    };
    const Eigen::Matrix<W, 3, 1> e = line(pair[0]).cross(line(pair[1]));
    const Eigen::Matrix<W, 3, 3> F = SO3<W>::hat(e) * H;
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
        for (std::size_t k = 0; k < 7; ++k) {
          p.col(static_cast<Eigen::Index>(k)) = matches.first(sample[k]);
          q.col(static_cast<Eigen::Index>(k)) = matches.second(sample[k]);
        }
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
