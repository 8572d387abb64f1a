// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "dynslam/geometry/detail/normalised_matches.hpp"
#include "dynslam/geometry/epipolar_distance.hpp"
#include "dynslam/geometry/homography.hpp"
#include "dynslam/geometry/minimal_models.hpp"
#include "dynslam/geometry/so3.hpp"
#include "dynslam/robust/consensus.hpp"

namespace dynslam::detail {

/// Without the direction that it maps to the least: the eigenvector of F^T F with the smallest eigenvalue.
template <std::same_as<double> W>
[[nodiscard]] std::optional<Eigen::Matrix<W, 3, 3>> nearest_of_rank_two(const Eigen::Matrix<W, 3, 3>& m) {
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
    return nearest_of_rank_two<W>(as_matrix(*f));
  }

 private:
  const NormalisedMatches& matches_;
  double limit_;
  std::vector<double> weights_;
};

/// Where most inliers of F are on a plane its sample mostly was, too, and any F of that plane's pencil was
/// taken. The one of the scene is H and two matches off the plane: [e]x H, e being where their lines cross
/// (DEGENSAC, Chum et al. 2005).
/// @param planes  the search for H
/// @param index   scratch
template <class Matches, class Search, class PlaneSearch, std::same_as<double> W = double>
void leave_plane(const Matches& matches, std::uint64_t seed, const Search& fundamental, PlaneSearch& planes,
                 BestModel<Search>& best, std::vector<int>& index) {
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

/// F by samples of seven, and away from a plane. @return iterations
template <std::floating_point S, class Matches, class Search, class PlaneSearch>
int sample_fundamentals(const Matches& matches, const RansacOptions<S>& options, const Search& search,
                        PlaneSearch& planes, BestModel<Search>& best, std::vector<int>& index) {
  const int iterations = search_models<7, S>(
      matches.size(), options, best, [&](const std::array<std::size_t, 7>& sample, const auto& consider) {
        Eigen::Matrix<double, 3, 7> p, q;
        for (std::size_t k = 0; k < 7; ++k)
          matches.copy_points(sample[k], p.data() + 3 * k, q.data() + 3 * k);
        std::array<Eigen::Matrix3d, 3> F;
        const int hypotheses = fundamental_seven_point(p, q, F);
        for (int k = 0; k < hypotheses; ++k) consider(F[static_cast<std::size_t>(k)]);
      });
  leave_plane(matches, options.seed, search, planes, best, index);
  return iterations;
}

}  // namespace dynslam::detail

#include "dynslam/pop_macros.hpp"
