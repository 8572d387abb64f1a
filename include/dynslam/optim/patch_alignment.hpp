// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>

#include "dynslam/concepts/image.hpp"
#include "dynslam/image/widen.hpp"

namespace dynslam {

/// Options of AlignmentPatch::align.
template <std::floating_point S>
struct PatchAlignmentOptions {
  int max_iterations = 10;
  S tolerance = S(0.02);       ///< step that ends the iteration [px]
  S max_shift = S(6);          ///< farther from the start the match is refused [px]
  S min_correlation = S(0.8);  ///< zero-mean normalised cross-correlation at the result
};

/// How AlignmentPatch::align ended.
enum class PatchAlignmentStatus : std::uint8_t {
  found,
  max_iterations,  ///< still moving
  outside,         ///< the patch left the image, or started outside
  too_far,         ///< moved farther than max_shift
  unlike           ///< converged, but correlates too little
};

/// Where AlignmentPatch::align found the patch.
template <std::floating_point S>
struct PatchAlignmentResult {
  Eigen::Matrix<S, 2, 1> x;  ///< position of the patch's origin in the image [px]
  S correlation = S(0);      ///< zero-mean normalised cross-correlation, -1..1; 0 without convergence
  int iterations = 0;
  PatchAlignmentStatus status = PatchAlignmentStatus::max_iterations;
  [[nodiscard]] bool ok() const { return status == PatchAlignmentStatus::found; }
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
    Row xx = Row::Zero(), xy = Row::Zero(), yy = Row::Zero(), x1 = Row::Zero(), y1 = Row::Zero();
    Row sum = Row::Zero(), sum2 = Row::Zero();
    for (int y = 0; y < N; ++y) {
      const auto row = [&](int dx, int dy) {
        return Eigen::Map<const Row>(bordered.data() + (y + 1 + dy) * kBordered + 1 + dx);
      };
      const auto k = static_cast<std::size_t>(y);
      value_[k] = row(0, 0);
      gx_[k] = S(0.5) * (row(1, 0) - row(-1, 0));
      gy_[k] = S(0.5) * (row(0, 1) - row(0, -1));
      xx += gx_[k] * gx_[k];
      xy += gx_[k] * gy_[k];
      yy += gy_[k] * gy_[k];
      x1 += gx_[k];
      y1 += gy_[k];
      sum += value_[k];
      sum2 += value_[k] * value_[k];
    }
    const Symmetric H{xx.sum(), xy.sum(), x1.sum(), yy.sum(), y1.sum(), S(N * N)};
    mean_ = sum.sum() / S(N * N);
    variance_ = sum2.sum() / S(N * N) - mean_ * mean_;
    const S trace = H.xx + H.yy, gap = H.xx - H.yy;
    const S smallest = S(0.5) * (trace - std::sqrt(gap * gap + S(4) * H.xy * H.xy));
    if (!(smallest > min_eigenvalue * S(N * N))) return false;
    inverse_ = H.inverse();
    return inverse_.is_finite();
  }

  /// Finds the template in `image`, starting at `start`.
  template <RowImage I>
  [[nodiscard]] PatchAlignmentResult<S> align(const I& image, const Eigen::Matrix<S, 2, 1>& start,
                                              const PatchAlignmentOptions<S>& options = {}) const {
    PatchAlignmentResult<S> result;
    result.x = start;
    S bias = S(0);
    std::array<Row, static_cast<std::size_t>(N)> sample;
    const S reach = S(N / 2);
    for (result.iterations = 0; result.iterations < options.max_iterations;) {
      const S u = result.x.x() - reach, v = result.x.y() - reach;
      if (!(u >= S(0) && v >= S(0) && u < S(image.width() - N - 1) && v < S(image.height() - N - 1))) {
        result.status = PatchAlignmentStatus::outside;
        return result;
      }
      const int u0 = static_cast<int>(u), v0 = static_cast<int>(v);
      const S a = u - S(u0), b = v - S(v0);
      // A row is interpolated between columns once and serves the row above and the one below. One sum per
      // column: they are independent, so each set stays in vector registers.
      Row rx = Row::Zero(), ry = Row::Zero(), rb = Row::Zero();
      Row top = interpolated(image.row(v0) + u0, a);
      for (int y = 0; y < N; ++y) {
        const auto k = static_cast<std::size_t>(y);
        const Row bottom = interpolated(image.row(v0 + y + 1) + u0, a);
        sample[k] = top + b * (bottom - top);
        const Row r = sample[k] - value_[k] - bias;
        rx += r * gx_[k];
        ry += r * gy_[k];
        rb += r;
        top = bottom;
      }
      const S s_x = rx.sum(), s_y = ry.sum(), s_b = rb.sum();
      const Symmetric& A = inverse_;
      const S step_x = total(A.xx * s_x, A.xy * s_y, A.xz * s_b),
              step_y = total(A.xy * s_x, A.yy * s_y, A.yz * s_b);
      ++result.iterations;
      result.x.x() -= step_x;
      result.x.y() -= step_y;
      bias += A.xz * s_x + (A.yz * s_y + A.zz * s_b);
      const S shift_x = result.x.x() - start.x(), shift_y = result.x.y() - start.y();
      if (!(shift_x * shift_x + shift_y * shift_y < options.max_shift * options.max_shift)) {
        result.status = PatchAlignmentStatus::too_far;
        return result;
      }
      if (step_x * step_x + step_y * step_y < options.tolerance * options.tolerance) {
        result.correlation = correlation(sample);
        result.status = result.correlation >= options.min_correlation ? PatchAlignmentStatus::found
                                                                      : PatchAlignmentStatus::unlike;
        return result;
      }
    }
    return result;
  }

 private:
  using Row = Eigen::Array<S, N, 1>;

  /// a + b + c in the order in which Eigen's products add: doubles from the left, floats from the right.
  [[nodiscard]] static S total(S a, S b, S c) {
    if constexpr (std::same_as<S, float>) {
      return a + (b + c);
    } else {
      return a + b + c;
    }
  }

  /// The symmetric matrix [xx xy xz; xy yy yz; xz yz zz].
  struct Symmetric {
    S xx = S(0), xy = S(0), xz = S(0), yy = S(0), yz = S(0), zz = S(0);

    [[nodiscard]] Symmetric inverse() const {
      const S c_xx = yy * zz - yz * yz, c_xy = yz * xz - xy * zz, c_xz = xy * yz - yy * xz;
      const S scale = S(1) / total(c_xx * xx, c_xy * xy, c_xz * xz);
      return {c_xx * scale,
              c_xy * scale,
              c_xz * scale,
              (zz * xx - xz * xz) * scale,
              (xz * xy - yz * xx) * scale,
              (xx * yy - xy * xy) * scale};
    }
    [[nodiscard]] bool is_finite() const {
      for (const S& a : {xx, xy, xz, yy, yz, zz}) {
        if (!std::isfinite(a)) return false;
      }
      return true;
    }
  };

  /// N values between the pixels at `p` and their right neighbours.
  template <class P>
  [[nodiscard]] static Row interpolated(const P* p, S a) {
    const Row left = widen<S, N>(p), right = widen<S, N>(p + 1);
    return left + a * (right - left);
  }

  /// Zero-mean normalised cross-correlation of the template with an image's values.
  [[nodiscard]] S correlation(const std::array<Row, static_cast<std::size_t>(N)>& sample) const {
    Row sum = Row::Zero(), sum2 = Row::Zero(), cross = Row::Zero();
    for (std::size_t k = 0; k < sample.size(); ++k) {
      sum += sample[k];
      sum2 += sample[k] * sample[k];
      cross += sample[k] * value_[k];
    }
    const S mean = sum.sum() / S(N * N);
    const S variance = sum2.sum() / S(N * N) - mean * mean;
    return (cross.sum() / S(N * N) - mean * mean_) / std::sqrt(variance * variance_ + S(1e-6));
  }

  std::array<Row, static_cast<std::size_t>(N)> value_{}, gx_{}, gy_{};
  Symmetric inverse_;
  S mean_ = S(0), variance_ = S(0);
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
