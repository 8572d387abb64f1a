// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "dynslam/geometry/detail/normalised_matches.hpp"
#include "dynslam/geometry/pixel_ray.hpp"
#include "dynslam/geometry/so3.hpp"
#include "dynslam/robust/consensus.hpp"

namespace dynslam::detail {

/// Matches of two images as rays: what NormalisedMatches is for pixels. The rays of each image are turned
/// until their middle is the z axis, and stretched across it by the inverse of their spread, as Hartley's
/// similarity does with pixels; what a pixel changes is stretched with them, so that distances stay recorded
/// pixels.
class RayMatches {
 public:
  /// Numbers are kept in `memory`.
  void set(std::span<const PixelRay<double>> x, std::span<const PixelRay<double>> x_m,
           RansacWorkspace& memory) {
    n_ = std::min(x.size(), x_m.size());
    T_ = stretch(x.first(n_), memory.sorted);
    T_m_ = stretch(x_m.first(n_), memory.sorted);
    const Eigen::Matrix3d T_m_inverse = T_m_.inverse(), T_m_inverse_T = T_m_inverse.transpose();
    memory.coarse.assign(kCoarse * padded(n_), 0.0F);
    memory.fine.resize(kFine * n_);
    coarse_ = memory.coarse.data();
    fine_ = memory.fine.data();
    for (std::size_t i = 0; i < n_; ++i) {
      const PixelRay<double>&a = x[i], &b = x_m[i];
      const Eigen::Vector3d p = product<double>(T_, a.ray), q = product<double>(T_m_, b.ray),
                            normal = product<double>(T_m_inverse_T, b.ray);
      float* rows = memory.coarse.data() + at(i);
      const auto put = [&](double value) {
        *rows = static_cast<float>(value);
        rows += kMatchBlock;
      };
      for (int k = 0; k < 3; ++k) put(p[k]);
      for (int k = 0; k < 3; ++k) put(q[k]);
      for (const auto& [T, ray] : {std::pair{&T_, &a}, std::pair{&T_m_, &b}}) {
        for (int c = 0; c < 2; ++c) {
          const Eigen::Vector3d slope = product<double>(*T, Eigen::Vector3d(ray->per_pixel.col(c)));
          for (int k = 0; k < 3; ++k) put(slope[k]);
        }
      }
      for (int r = 0; r < 2; ++r) {
        const Eigen::Vector3d slope = product<double>(T_m_inverse_T, Eigen::Vector3d(b.J.row(r).transpose()));
        for (int k = 0; k < 3; ++k) put(slope[k]);
      }
      for (int k = 0; k < 3; ++k) put(normal[k]);
      const double fine[kFine] = {p[0],        p[1],        p[2],        q[0],
                                  q[1],        q[2],        p[0] * p[0], p[0] * p[1],
                                  p[0] * p[2], p[1] * p[1], p[1] * p[2], p[2] * p[2]};
      for (std::size_t r = 0; r < kFine; ++r) memory.fine[r * n_ + i] = fine[r];
    }
  }

  [[nodiscard]] std::size_t size() const { return n_; }
  [[nodiscard]] Eigen::Vector3d first(std::size_t i) const {
    return {fine_[i], fine_[n_ + i], fine_[2 * n_ + i]};
  }
  [[nodiscard]] Eigen::Vector3d second(std::size_t i) const {
    return {fine_[3 * n_ + i], fine_[4 * n_ + i], fine_[5 * n_ + i]};
  }
  /// Both rays of a match.
  void copy_points(std::size_t i, double* p, double* q) const {
    for (std::size_t k = 0; k < 3; ++k) {
      p[k] = fine_[k * n_ + i];
      q[k] = fine_[(k + 3) * n_ + i];
    }
  }
  /// Turned and stretched from rays: of the first and of the second image.
  [[nodiscard]] const Eigen::Matrix3d& T() const { return T_; }
  [[nodiscard]] const Eigen::Matrix3d& T_m() const { return T_m_; }

  /// Rows in double: 0 to 2 of p, 3 to 5 of q.
  [[nodiscard]] const double* fine(std::size_t r) const { return fine_ + r * n_; }
  // In float, blocks of kMatchBlock matches lie together, filled up with zeros, and in each a row of so many
  // numbers for every component: rows of all matches would lie a power of two apart, which caches dislike.
  static constexpr std::size_t kVector = 3 * kMatchBlock;
  /// Offset in a block of p, of q, of the changes of p, then of q, with a pixel to the right and one down
  /// [1/px], of the derivatives of the second image's u and v by q [px], and of what makes 1 with q.
  static constexpr std::size_t kP = 0, kQ = kVector, kPerPixel = 2 * kVector, kDerivative = 6 * kVector,
                               kNormal = 8 * kVector;
  /// The first components of a match.
  [[nodiscard]] const float* coarse(std::size_t i) const { return coarse_ + at(i); }

  /// Sum of value(match) over the matches, `match` being as of coarse(): sum_of_worths().
  template <class Value>
  [[nodiscard]] float sum(float beaten, const Value& value) const {
    return sum_of_worths(n_, beaten, [&](std::size_t begin) {
      return [match = coarse(begin), &value](std::size_t k) { return value(match + k); };
    });
  }

  /// Sum of weight_i p_i p_i^T.
  [[nodiscard]] Eigen::Matrix3d moments(const double* weight) const {
    Eigen::Matrix3d M;
    std::size_t row = 6;
    for (int r = 0; r < 3; ++r) {
      for (int c = r; c < 3; ++c) M(r, c) = M(c, r) = dot_rows(n_, weight, fine(row++));
    }
    return M;
  }

 private:
  static constexpr std::size_t kCoarse = 27, kFine = 12;
  [[nodiscard]] static std::size_t at(std::size_t i) {
    return i / kMatchBlock * (kCoarse * kMatchBlock) + i % kMatchBlock;
  }

  /// The transform of an image's rays; medians, so that a few wrong ones change nothing.
  [[nodiscard]] static Eigen::Matrix3d stretch(std::span<const PixelRay<double>> rays,
                                               std::vector<double>& sorted) {
    if (rays.empty()) return Eigen::Matrix3d::Identity();
    sorted.resize(rays.size());
    Eigen::Vector3d middle;
    for (int k = 0; k < 3; ++k) {
      std::transform(rays.begin(), rays.end(), sorted.begin(), [k](const auto& r) { return r.ray[k]; });
      middle[k] = median_of(sorted);
    }
    const double norm = middle.norm();
    if (!(norm > 0.1)) return Eigen::Matrix3d::Identity();  // all around: there is no middle
    middle /= norm;
    int least = 0;
    middle.cwiseAbs().minCoeff(&least);
    Eigen::Matrix3d R;
    const Eigen::Vector3d right = middle.cross(Eigen::Vector3d::Unit(least)).normalized();
    R.row(0) = right.transpose();
    R.row(1) = middle.cross(right).transpose();
    R.row(2) = middle.transpose();
    std::transform(rays.begin(), rays.end(), sorted.begin(),
                   [&](const auto& r) { return middle.cross(r.ray).norm(); });
    const double spread = median_of(sorted);
    if (!(spread > 0)) return R;
    const double scale = std::max(1.0, std::sqrt(2.0) / spread);
    R.row(0) *= scale;
    R.row(1) *= scale;
    return R;
  }

  std::size_t n_ = 0;
  Eigen::Matrix3d T_ = Eigen::Matrix3d::Identity(), T_m_ = Eigen::Matrix3d::Identity();
  const float* coarse_ = nullptr;
  const double* fine_ = nullptr;
};

/// a . b, `a` being a vector of RayMatches.
[[nodiscard]] inline float dot_at(const float* a, float x, float y, float z) {
  return a[0] * x + a[kMatchBlock] * y + a[2 * kMatchBlock] * z;
}

/// FundamentalSearch for rays: Sampson's distance in recorded pixels.
template <std::same_as<double> W>  // of a template nothing is compiled where it is not used
class RayFundamentalSearch {
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
  RayFundamentalSearch(const RayMatches& matches, double limit) : matches_(matches), limit_(limit) {}

  [[nodiscard]] float score(const Eigen::Matrix<W, 3, 3>& F, float beaten) const {
    const auto distance = sampson(F);
    const float inverse = static_cast<float>(1 / limit_);
    return matches_.sum(beaten, [=](const float* match) {
      const auto [e2, g] = distance(match);
      return inlier_worth(e2 * inverse / (g + 1e-30F));
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
  [[nodiscard]] bool near(const Eigen::Matrix<W, 3, 3>& F, std::size_t i) const {
    const auto [e2, g] = sampson(F)(matches_.coarse(i));
    return static_cast<double>(e2) <= limit_ * static_cast<double>(g);
  }

  /// Least squares of Sampson's distances of the inliers of F, each equation weighed by its gradient at F,
  /// then the nearest matrix of rank 2.
  [[nodiscard]] std::optional<Eigen::Matrix<W, 3, 3>> refit(const Eigen::Matrix<W, 3, 3>& F, double wide) {
    const std::size_t n = matches_.size();
    const auto distance = sampson(F);
    const float far = static_cast<float>(wide * limit_);
    weights_.resize(2 * n);
    double *w = weights_.data(), *product_row = w + n;
    for (std::size_t i = 0; i < n; ++i) {
      const auto [e2, g] = distance(matches_.coarse(i));
      w[i] = e2 <= far * g && g > 0.0F ? 1 / static_cast<double>(g) : 0.0;
    }
    Eigen::Matrix<W, 9, 9> A;
    for (std::size_t r = 0; r < 3; ++r) {
      for (std::size_t c = r; c < 3; ++c) {
        const double *a = matches_.fine(3 + r), *b = matches_.fine(3 + c);
        for (std::size_t i = 0; i < n; ++i) product_row[i] = w[i] * a[i] * b[i];
        const Eigen::Matrix<W, 3, 3> m = matches_.moments(product_row);
        put_block(A, static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(c), m);
        put_block(A, static_cast<Eigen::Index>(c), static_cast<Eigen::Index>(r), m);
      }
    }
    const auto f = smallest_eigenvector(A, as_vector(F));
    if (!f) return std::nullopt;
    return nearest_of_rank_two<W>(as_matrix(*f));
  }

 private:
  const RayMatches& matches_;
  double limit_;
  std::vector<double> weights_;
};

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
    const float inverse = static_cast<float>(1 / limit_);
    return matches_.sum(beaten, [=](const float* match) {
      const auto [d2, along] = distance(match);
      // Nothing behind. Of a choice, g++ makes branches here and no vectors.
      const float in_front = 0.5F * (along + std::abs(along));
      return inlier_worth(d2 * inverse / (in_front * in_front + 1e-30F));
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
  [[nodiscard]] bool near(const Eigen::Matrix<W, 3, 3>& H, std::size_t i) const {
    const auto [d2, along] = transfer_error(H)(matches_.coarse(i));
    return along > 0.0F && static_cast<double>(d2) <= limit_ * static_cast<double>(along * along);
  }

  /// Least squares of the inliers' transfer errors, each divided by what H p has along the match.
  [[nodiscard]] std::optional<Eigen::Matrix<W, 3, 3>> refit(const Eigen::Matrix<W, 3, 3>& H, double wide) {
    const std::size_t n = matches_.size();
    const auto distance = transfer_error(H);
    const float far = static_cast<float>(wide * limit_);
    weights_.resize(2 * n);
    double *w = weights_.data(), *product_row = w + n;
    for (std::size_t i = 0; i < n; ++i) {
      const auto [d2, along] = distance(matches_.coarse(i));
      w[i] = d2 <= far * along * along && along > 0.0F ? 1 / static_cast<double>(along * along) : 0.0;
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
        const Eigen::Matrix<W, 3, 3> m = matches_.moments(product_row);
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
