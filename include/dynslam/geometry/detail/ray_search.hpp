// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <optional>
#include <tuple>
#include <vector>

#include "dynslam/geometry/detail/best_model.hpp"
#include "dynslam/geometry/detail/epipolar_step.hpp"
#include "dynslam/geometry/detail/normalised_matches.hpp"
#include "dynslam/geometry/homography.hpp"
#include "dynslam/geometry/ray_matches.hpp"

namespace dynslam::detail {

/// FundamentalSearch for rays: Sampson's distance in recorded pixels.
/// @tparam Step  RankTwoStep or EssentialStep: among which matrices
template <std::same_as<double> W, class Step>  // of a template nothing is compiled where it is not used
class RayEpipolarSearch {
  struct Parts {
    float e2, g;
  };
  [[nodiscard]] auto sampson(const Eigen::Matrix<W, 3, 3>& F) const {
    const Eigen::Matrix<float, 3, 3> f = F.template cast<float>();
    const float f00 = f(0, 0), f01 = f(0, 1), f02 = f(0, 2), f10 = f(1, 0), f11 = f(1, 1), f12 = f(1, 2),
                f20 = f(2, 0), f21 = f(2, 1), f22 = f(2, 2);
    return [=](const float* match) {
      using M = RayMatches;
      constexpr std::size_t n = kMatchBlock;
      const float *p = match + M::kP, *q = match + M::kQ, *slopes = match + M::kPerPixel;
      const float x = p[0], y = p[n], z = p[2 * n];
      const float a = f00 * x + f01 * y + f02 * z, b = f10 * x + f11 * y + f12 * z,
                  c = f20 * x + f21 * y + f22 * z;
      const float x_m = q[0], y_m = q[n], z_m = q[2 * n];
      const float a_m = f00 * x_m + f10 * y_m + f20 * z_m, b_m = f01 * x_m + f11 * y_m + f21 * z_m,
                  c_m = f02 * x_m + f12 * y_m + f22 * z_m;
      const float u = dot_at(slopes, a_m, b_m, c_m), v = dot_at(slopes + M::kVector, a_m, b_m, c_m),
                  u_m = dot_at(slopes + 2 * M::kVector, a, b, c),
                  v_m = dot_at(slopes + 3 * M::kVector, a, b, c);
      const float e = a * x_m + b * y_m + c * z_m;
      return Parts{e * e, u * u + v * v + u_m * u_m + v_m * v_m};
    };
  }

 public:
  /// @param limit  squared threshold [px^2]
  RayEpipolarSearch(const RayMatches& matches, double limit) : matches_(matches), limit_(limit) {}

  [[nodiscard]] float score(const Eigen::Matrix<W, 3, 3>& F, float beaten) const {
    const auto distance = sampson(F);
    const float inverse = static_cast<float>(1 / limit_);
    return matches_.sum(beaten, [=](const float* match) {
      const auto [e2, g] = distance(match);
      return inlier_worth(e2 * inverse / (g + 1e-16F));
    });
  }
  [[nodiscard]] int inliers(const Eigen::Matrix<W, 3, 3>& F) const {
    const auto distance = sampson(F);
    const float limit = static_cast<float>(limit_);
    return static_cast<int>(matches_.sum(-1.0F, [=](const float* match) {
      const auto [e2, g] = distance(match);
      return e2 <= limit * g ? 1.0F : 0.0F;
    }));
  }
  [[nodiscard]] std::size_t size() const { return matches_.size(); }
  [[nodiscard]] bool near(const Eigen::Matrix<W, 3, 3>& F, std::size_t i) const {
    const auto [e2, g] = sampson(F)(matches_.coarse(i));
    return static_cast<double>(e2) <= limit_ * static_cast<double>(g);
  }

  /// A step of Gauss-Newton's towards the least squares of Sampson's distances, robust (Tukey's biweight).
  /// @tparam T     of the sums
  /// @param which  FirstMatches or ListedMatches
  /// @param wide   of the squared threshold, from where a match counts nothing
  template <std::floating_point T, class Which>
  [[nodiscard]] std::optional<Eigen::Matrix<W, 3, 3>> step(const Eigen::Matrix<W, 3, 3>& F,
                                                           const Which& which, double wide) {
    auto& equations = std::get<SampsonEquations<T>>(equations_);
    equations.set_zero();
    for (std::size_t begin = 0; begin < which.size(); begin += kMatchBlock) {
      const std::size_t size = std::min(kMatchBlock, which.size() - begin);
      fill<T>(F, equations.block(), [&](std::size_t i) { return which(begin + std::min(i, size - 1)); });
      equations.add(size, static_cast<T>(wide * limit_));
    }
    return Step::template from<W>(F, equations);
  }

 private:
  template <std::floating_point T, class At>
  void fill(const Eigen::Matrix<W, 3, 3>& F, typename SampsonEquations<T>::Block& m, const At& at) const {
    using Vector = typename SampsonEquations<T>::Vector;
    const Eigen::Matrix<T, 3, 3> f = F.template cast<T>();
    std::array<const float*, kMatchBlock> coarse;
    Vector line, line_m;
    for (std::size_t i = 0; i < kMatchBlock; ++i) {
      const std::size_t k = at(i);
      coarse[i] = matches_.coarse(k);
      for (std::size_t r = 0; r < 3; ++r) {
        m.p[r][i] = static_cast<T>(matches_.fine(r)[k]);
        m.q[r][i] = static_cast<T>(matches_.fine(r + 3)[k]);
      }
    }
    for (std::size_t r = 0; r < 3; ++r) {
      const auto at_r = static_cast<Eigen::Index>(r);
      const T a = f(at_r, 0), b = f(at_r, 1), c = f(at_r, 2), a_m = f(0, at_r), b_m = f(1, at_r),
              c_m = f(2, at_r);
      for (std::size_t i = 0; i < kMatchBlock; ++i) {
        line[r][i] = a * m.p[0][i] + b * m.p[1][i] + c * m.p[2][i];
        line_m[r][i] = a_m * m.q[0][i] + b_m * m.q[1][i] + c_m * m.q[2][i];
      }
    }
    for (std::size_t i = 0; i < kMatchBlock; ++i)
      m.e[i] = line[0][i] * m.q[0][i] + line[1][i] * m.q[1][i] + line[2][i] * m.q[2][i];
    // What a pixel changes a ray by, per_pixel, gives the gradient per_pixel^T line, and h = per_pixel of it.
    m.g.fill(T(0));
    for (Vector* of : {&m.h, &m.k}) {
      for (auto& row : *of) row.fill(T(0));
    }
    for (std::size_t slope = 0; slope < 4; ++slope) {
      const Vector& of = slope < 2 ? line_m : line;
      Vector& to = slope < 2 ? m.k : m.h;
      for (std::size_t i = 0; i < kMatchBlock; ++i) {
        const float* s = coarse[i] + RayMatches::kPerPixel + slope * RayMatches::kVector;
        const T x = static_cast<T>(s[0]), y = static_cast<T>(s[kMatchBlock]),
                z = static_cast<T>(s[2 * kMatchBlock]);
        const T change = x * of[0][i] + y * of[1][i] + z * of[2][i];
        m.g[i] += change * change;
        to[0][i] += change * x;
        to[1][i] += change * y;
        to[2][i] += change * z;
      }
    }
  }

  const RayMatches& matches_;
  double limit_;
  std::tuple<SampsonEquations<float>, SampsonEquations<double>> equations_;
};

template <std::same_as<double> W>
using RayFundamentalSearch = RayEpipolarSearch<W, RankTwoStep>;
template <std::same_as<double> W>
using RayEssentialSearch = RayEpipolarSearch<W, EssentialStep>;

/// HomographySearch for rays: transfer errors in recorded pixels, in the plane that touches at the match.
template <std::same_as<double> W>
class RayHomographySearch {
  struct Parts {
    float d2, along;  // of the numerators
  };
  [[nodiscard]] auto transfer_error(const Eigen::Matrix<W, 3, 3>& H) const {
    const Eigen::Matrix<float, 3, 3> h = H.template cast<float>();
    const float h00 = h(0, 0), h01 = h(0, 1), h02 = h(0, 2), h10 = h(1, 0), h11 = h(1, 1), h12 = h(1, 2),
                h20 = h(2, 0), h21 = h(2, 1), h22 = h(2, 2);
    return [=](const float* match) {
      using M = RayMatches;
      const float *p = match + M::kP, *derivative = match + M::kDerivative;
      const float x = p[0], y = p[kMatchBlock], z = p[2 * kMatchBlock];
      const float a = h00 * x + h01 * y + h02 * z, b = h10 * x + h11 * y + h12 * z,
                  c = h20 * x + h21 * y + h22 * z;
      const float du = dot_at(derivative, a, b, c), dv = dot_at(derivative + M::kVector, a, b, c);
      return Parts{du * du + dv * dv, dot_at(match + M::kNormal, a, b, c)};
    };
  }

 public:
  /// @param limit  squared threshold [px^2]
  RayHomographySearch(const RayMatches& matches, double limit) : matches_(matches), limit_(limit) {}

  [[nodiscard]] float score(const Eigen::Matrix<W, 3, 3>& H, float beaten) const {
    const auto distance = transfer_error(H);
    const float inverse = static_cast<float>(1 / (kTransferReach * limit_));
    return matches_.sum(beaten, [=](const float* match) {
      const auto [d2, along] = distance(match);
      // Nothing behind. Of a choice, g++ makes branches here and no vectors.
      const float in_front = 0.5F * (along + std::abs(along));
      return inlier_worth(d2 * inverse / (in_front * in_front + 1e-12F));
    });
  }
  [[nodiscard]] int inliers(const Eigen::Matrix<W, 3, 3>& H) const {
    const auto distance = transfer_error(H);
    const float limit = static_cast<float>(limit_);
    return static_cast<int>(matches_.sum(-1.0F, [=](const float* match) {
      const auto [d2, along] = distance(match);
      return d2 <= limit * along * along && along > 0.0F ? 1.0F : 0.0F;
    }));
  }
  [[nodiscard]] std::size_t size() const { return matches_.size(); }
  [[nodiscard]] bool near(const Eigen::Matrix<W, 3, 3>& H, std::size_t i, double wide = 1) const {
    const auto [d2, along] = transfer_error(H)(matches_.coarse(i));
    return along > 0.0F && static_cast<double>(d2) <= wide * limit_ * static_cast<double>(along * along);
  }

  /// Least squares of the transfer errors, robust (Tukey's biweight), each divided by what H p has along the
  /// match.
  /// @param first  matches
  /// @param wide   of the squared threshold, from where a match counts nothing
  template <std::floating_point T>
  [[nodiscard]] std::optional<Eigen::Matrix<W, 3, 3>> step(const Eigen::Matrix<W, 3, 3>& H,
                                                           const FirstMatches& first, double wide) {
    const std::size_t n = first.size();
    const auto distance = transfer_error(H);
    const float inverse = static_cast<float>(1 / (wide * kTransferReach * limit_));
    weights_.resize(2 * n);
    double *w = weights_.data(), *product_row = w + n;
    for (std::size_t i = 0; i < n; ++i) {
      const auto [d2, along] = distance(matches_.coarse(i));
      const float square = along * along, left = 1.0F - d2 * inverse / square;
      w[i] = left > 0.0F && along > 0.0F ? static_cast<double>(left * left / square) : 0.0;
    }
    Eigen::Matrix<W, 9, 9> A;
    for (std::size_t r = 0; r < 3; ++r) {
      for (std::size_t c = r; c < 3; ++c) {
        for (std::size_t i = 0; i < n; ++i) {
          const float *u = matches_.coarse(i) + RayMatches::kDerivative, *v = u + RayMatches::kVector;
          const auto of = [](const float* row, std::size_t k) {
            return static_cast<double>(row[k * kMatchBlock]);
          };
          product_row[i] = w[i] * (of(u, r) * of(u, c) + of(v, r) * of(v, c));
        }
        const Eigen::Matrix<W, 3, 3> m = matches_.moments(n, product_row);
        put_block(A, static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(c), m);
        put_block(A, static_cast<Eigen::Index>(c), static_cast<Eigen::Index>(r), m);
      }
    }
    const auto h = smallest_eigenvector(A, as_vector(H));
    if (!h) return std::nullopt;
    return as_matrix(*h);
  }

 private:
  const RayMatches& matches_;
  double limit_;
  std::vector<double> weights_;
};

}  // namespace dynslam::detail

#include "dynslam/pop_macros.hpp"
