// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <span>

#include "dynslam/concepts/image.hpp"

namespace dynslam {

template <std::floating_point S>
struct PatchAlignmentOptions {
  int max_iterations = 10;
  S tolerance = S(0.02);       ///< step that ends the iteration [px]
  S max_shift = S(6);          ///< farther from the start the match is refused [px]
  S min_correlation = S(0.8);  ///< zero-mean normalised cross-correlation at the result
};

template <std::floating_point S>
struct PatchAlignmentResult {
  Eigen::Matrix<S, 2, 1> x;  ///< position of the patch's origin in the image [px]
  S correlation = S(0);      ///< zero-mean normalised cross-correlation, -1..1
  int iterations = 0;
  bool ok = false;  ///< converged inside the image, near the start, and looks alike
};

/// An N x N template that is found in images with sub-pixel accuracy by inverse-compositional
/// alignment of position and brightness offset (Baker and Matthews 2004; gradients and Hessian are
/// those of the template, computed once). The origin is the template's pixel (N/2, N/2).
template <std::floating_point S, int N = 8>
class AlignmentPatch {
 public:
  static constexpr int kSize = N;
  static constexpr int kBordered = N + 2;

  /// Sets the template.
  /// @param bordered       its grey values with a border of one pixel, row-major, (N + 2) x (N + 2)
  /// @param min_eigenvalue smallest accepted eigenvalue of the mean gradient product [grey^2/px^2]
  /// @return false where the template does not determine a position (flat, or a straight edge)
  bool set(std::span<const S, static_cast<std::size_t>(kBordered* kBordered)> bordered, S min_eigenvalue) {
    Eigen::Matrix<S, 3, 3> H = Eigen::Matrix<S, 3, 3>::Zero();
    S sum = S(0), sum2 = S(0);
    for (int y = 0; y < N; ++y) {
      const S* centre = bordered.data() + (y + 1) * kBordered + 1;
      for (int x = 0; x < N; ++x) {
        const auto k = static_cast<std::size_t>(y * N + x);
        const S gx = S(0.5) * (centre[x + 1] - centre[x - 1]);
        const S gy = S(0.5) * (centre[x + kBordered] - centre[x - kBordered]);
        value_[k] = centre[x];
        gx_[k] = gx;
        gy_[k] = gy;
        H(0, 0) += gx * gx;
        H(0, 1) += gx * gy;
        H(1, 1) += gy * gy;
        H(0, 2) += gx;
        H(1, 2) += gy;
        sum += centre[x];
        sum2 += centre[x] * centre[x];
      }
    }
    H(2, 2) = S(N * N);
    H(1, 0) = H(0, 1);
    H(2, 0) = H(0, 2);
    H(2, 1) = H(1, 2);
    mean_ = sum / S(N * N);
    variance_ = sum2 / S(N * N) - mean_ * mean_;
    const S trace = H(0, 0) + H(1, 1), gap = H(0, 0) - H(1, 1);
    const S smallest = S(0.5) * (trace - std::sqrt(gap * gap + S(4) * H(0, 1) * H(0, 1)));
    if (!(smallest > min_eigenvalue * S(N * N))) return false;
    inverse_ = H.inverse();
    return inverse_.allFinite();
  }

  /// Finds the template in `image`, starting at `start`.
  template <RowImage I>
  [[nodiscard]] PatchAlignmentResult<S> align(const I& image, const Eigen::Matrix<S, 2, 1>& start,
                                              const PatchAlignmentOptions<S>& options = {}) const {
    PatchAlignmentResult<S> result;
    result.x = start;
    S bias = S(0);
    const S reach = S(N / 2);
    for (result.iterations = 0; result.iterations < options.max_iterations;) {
      const S u = result.x.x() - reach, v = result.x.y() - reach;
      if (!(u >= S(0) && v >= S(0) && u < S(image.width() - N - 1) && v < S(image.height() - N - 1)))
        return result;
      const int u0 = static_cast<int>(u), v0 = static_cast<int>(v);
      const S a = u - S(u0), b = v - S(v0);
      const S w00 = (S(1) - a) * (S(1) - b), w10 = a * (S(1) - b), w01 = (S(1) - a) * b, w11 = a * b;
      S rx = S(0), ry = S(0), rb = S(0);
      S sum = S(0), sum2 = S(0), cross = S(0);
      for (int y = 0; y < N; ++y) {
        const auto* top = image.row(v0 + y) + u0;
        const auto* bottom = image.row(v0 + y + 1) + u0;
        const S* value = value_.data() + y * N;
        const S* gx = gx_.data() + y * N;
        const S* gy = gy_.data() + y * N;
        for (int x = 0; x < N; ++x) {
          const S sample = w00 * static_cast<S>(top[x]) + w10 * static_cast<S>(top[x + 1]) +
                           w01 * static_cast<S>(bottom[x]) + w11 * static_cast<S>(bottom[x + 1]);
          const S r = sample - value[x] - bias;
          rx += r * gx[x];
          ry += r * gy[x];
          rb += r;
          sum += sample;
          sum2 += sample * sample;
          cross += sample * value[x];
        }
      }
      const S mean = sum / S(N * N);
      const S variance = sum2 / S(N * N) - mean * mean;
      result.correlation = (cross / S(N * N) - mean * mean_) / std::sqrt(variance * variance_ + S(1e-6));
      const Eigen::Matrix<S, 3, 1> step = inverse_ * Eigen::Matrix<S, 3, 1>(rx, ry, rb);
      ++result.iterations;
      result.x -= step.template head<2>();
      bias += step.z();
      if (!((result.x - start).squaredNorm() < options.max_shift * options.max_shift)) return result;
      if (step.template head<2>().squaredNorm() < options.tolerance * options.tolerance) {
        result.ok = result.correlation >= options.min_correlation;
        return result;
      }
    }
    return result;
  }

 private:
  std::array<S, static_cast<std::size_t>(N*N)> value_{}, gx_{}, gy_{};
  Eigen::Matrix<S, 3, 3> inverse_ = Eigen::Matrix<S, 3, 3>::Zero();
  S mean_ = S(0), variance_ = S(0);
};

}  // namespace dynslam
