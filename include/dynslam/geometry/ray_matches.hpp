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
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/concepts/scalar.hpp"
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
  /// @param stretched  false: the rays are left as they are, so that essential matrices stay such
  void set(std::span<const PixelRay<double>> x, std::span<const PixelRay<double>> x_m,
           RansacWorkspace& memory, bool stretched = true) {
    n_ = std::min(x.size(), x_m.size());
    T_ = stretched ? stretch(x.first(n_), memory.sorted) : Eigen::Matrix3d::Identity();
    T_m_ = stretched ? stretch(x_m.first(n_), memory.sorted) : Eigen::Matrix3d::Identity();
    const Eigen::Matrix3d T_m_inverse = T_m_.inverse(), T_m_inverse_T = T_m_inverse.transpose();
    memory.coarse.assign(kCoarse * padded(n_), 0.0F);
    memory.fine.resize(kFine * n_ + kMatchBlock);  // whole blocks can be read from any row
    memory.index.resize(n_);
    std::iota(memory.index.begin(), memory.index.end(), 0);
    shuffle(memory.index);
    coarse_ = memory.coarse.data();
    fine_ = memory.fine.data();
    for (std::size_t i = 0; i < n_; ++i) {
      const auto match = static_cast<std::size_t>(memory.index[i]);
      const PixelRay<double>&a = x[match], &b = x_m[match];
      const Eigen::Vector3d p = product<double>(T_, a.ray), q = product<double>(T_m_, b.ray),
                            normal = product<double>(T_m_inverse_T, b.ray);
      float* rows = memory.coarse.data() + at(i);
      const auto put = [&](double value) {
        *rows = static_cast<float>(std::clamp(value, -kSteepest, kSteepest));
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

  /// Sum of weight_i p_i p_i^T over the first `n` matches.
  [[nodiscard]] Eigen::Matrix3d moments(std::size_t n, const double* weight) const {
    Eigen::Matrix3d M;
    std::size_t row = 6;
    for (int r = 0; r < 3; ++r) {
      for (int c = r; c < 3; ++c) M(r, c) = M(c, r) = dot_rows(n, weight, fine(row++));
    }
    return M;
  }

 private:
  static constexpr std::size_t kCoarse = 27, kFine = 12;
  static constexpr double kSteepest = 1e9;  // [px]: far outside of any image; squares of more overflow
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

template <Scalar S>
[[nodiscard]] PixelRay<double> ray_in_double(const PixelRay<S>& ray) {
  return {ray.ray.template cast<double>(), ray.J.template cast<double>(),
          ray.per_pixel.template cast<double>()};
}

/// The rays of matches of recorded pixels, and which match each is: without those that are not finite or have
/// none.
template <DifferentiableCamera C, class S = typename C::ScalarType>
void rays_of_matches(const C& camera, std::span<const Eigen::Matrix<S, 2, 1>> x,
                     std::span<const Eigen::Matrix<S, 2, 1>> x_m, std::vector<PixelRay<double>>& rays,
                     std::vector<PixelRay<double>>& rays_m, std::vector<std::size_t>& match) {
  rays.clear();
  rays_m.clear();
  match.clear();
  for (std::size_t i = 0; i < x.size(); ++i) {
    const auto a = pixel_ray_at(camera, x[i]), b = pixel_ray_at(camera, x_m[i]);
    if (!a || !b) continue;
    rays.push_back(ray_in_double(*a));
    rays_m.push_back(ray_in_double(*b));
    match.push_back(i);
  }
}

template <std::floating_point S>
[[nodiscard]] RansacOptions<double> ransac_in_double(const RansacOptions<S>& options) {
  return {static_cast<double>(options.threshold_px),
          static_cast<double>(options.confidence),
          options.max_iterations,
          options.min_inliers,
          options.refinements,
          options.seed};
}

/// a . b, `a` being a vector of RayMatches.
[[nodiscard]] inline float dot_at(const float* a, float x, float y, float z) {
  return a[0] * x + a[kMatchBlock] * y + a[2 * kMatchBlock] * z;
}

}  // namespace dynslam::detail

#include "dynslam/pop_macros.hpp"
