// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "dynslam/geometry/small_cholesky.hpp"
#include "dynslam/robust/consensus.hpp"
#include "dynslam/robust/split_mix64.hpp"

namespace dynslam::detail {

inline constexpr std::size_t kMatchBlock = 64;  ///< rows of floats are filled up to whole blocks
[[nodiscard]] inline std::size_t padded(std::size_t n) {
  return (n + kMatchBlock - 1) / kMatchBlock * kMatchBlock;
}

/// Middle one of the numbers, of which there must be one; they are reordered.
[[nodiscard]] inline double median_of(std::vector<double>& numbers) {
  const auto middle = numbers.begin() + static_cast<std::ptrdiff_t>(numbers.size() / 2);
  std::nth_element(numbers.begin(), middle, numbers.end());
  return *middle;
}

/// Puts indices into an order that tells nothing, the same in every run: any of its parts is a sample.
inline void shuffle(std::vector<int>& index) {
  SplitMix64 random(1);
  for (std::size_t i = index.size(); i > 1; --i)
    std::swap(index[i - 1], index[static_cast<std::size_t>(random.below(static_cast<int>(i)))]);
}

/// Sum over n matches, each worth 0 to 1; in float, block by block. Numbers up to padded(n) are asked for.
/// @param block  block(begin) gives a function of k, what the match begin + k is worth
/// @return less than 0 as soon as more than `beaten` cannot be reached, or is four standard deviations off
///         what the first matches, a random sample of all (shuffle), say
template <class Block>
[[nodiscard]] float sum_of_worths(std::size_t n, float beaten, const Block& block) {
  float total = 0;
  const float share = beaten / static_cast<float>(n), variance = share * (1.0F - share);
  for (std::size_t begin = 0; begin < n; begin += kMatchBlock) {
    const auto value = block(begin);
    std::array<float, kMatchBlock> values;
    for (std::size_t i = 0; i < kMatchBlock; ++i) values[i] = value(i);
    const std::size_t size = std::min(kMatchBlock, n - begin);
    for (std::size_t i = size; i < kMatchBlock; ++i) values[i] = 0;
    std::array<float, 8> lanes{};  // the same sum whatever a vector holds
    for (std::size_t i = 0; i < kMatchBlock; i += 8) {
      for (std::size_t k = 0; k < 8; ++k) lanes[k] += values[i + k];
    }
    total +=
        ((lanes[0] + lanes[4]) + (lanes[1] + lanes[5])) + ((lanes[2] + lanes[6]) + (lanes[3] + lanes[7]));
    const float seen = static_cast<float>(begin + size), missing = share * seen - total;
    if (total + (static_cast<float>(n) - seen) <= beaten) return -1.0F;
    if (missing > 0.0F && missing * missing > 16.0F * seen * variance) return -1.0F;
  }
  return total;
}

/// Sum of n products, in four lanes: the same whatever a vector holds.
[[nodiscard]] inline double dot_rows(std::size_t n, const double* a, const double* b) {
  std::array<double, 4> lanes{};
  const std::size_t fours = n / 4 * 4, twos = n / 2 * 2;
  for (std::size_t i = 0; i < fours; i += 4) {
    for (std::size_t k = 0; k < 4; ++k) lanes[k] += a[i + k] * b[i + k];
  }
  double even = lanes[0] + lanes[2], odd = lanes[1] + lanes[3];
  if (fours < twos) {
    even += a[fours] * b[fours];
    odd += a[fours + 1] * b[fours + 1];
  }
  const double sum = even + odd;
  return twos < n ? sum + a[twos] * b[twos] : sum;
}

/// Matches of two images as rows of numbers, each image's about its middle and both by one scale, so that
/// distances are those in pixels times `scale`. Models are searched in these coordinates: in float, where
/// thousands of distances are compared with a threshold, and solved for in double.
class NormalisedMatches {
 public:
  /// A match farther from the middle than so many times the spread is none that a camera saw, and is left
  /// out: with it, fourth powers in float would not be numbers.
  static constexpr double kFarthest = 1e4;

  /// Centre and scale are medians, so that matches far away do not move the others together. Those that are
  /// not finite or out of reach (kFarthest) are left out. Numbers are kept in `memory`.
  /// @return false where the points coincide, or fewer than `least` are left
  template <std::floating_point S>
  [[nodiscard]] bool set(std::span<const Eigen::Matrix<S, 2, 1>> x,
                         std::span<const Eigen::Matrix<S, 2, 1>> x_m, std::size_t n, std::size_t least,
                         RansacWorkspace& memory) {
    const auto numbers = [&](int k) {
      const auto i = static_cast<std::size_t>(k);
      return std::array<double, 4>{static_cast<double>(x[i][0]), static_cast<double>(x[i][1]),
                                   static_cast<double>(x_m[i][0]), static_cast<double>(x_m[i][1])};
    };
    auto& used = memory.index;
    used.clear();
    for (int i = 0; i < static_cast<int>(n); ++i) {
      const std::array<double, 4> v = numbers(i);
      if (std::all_of(v.begin(), v.end(), [](double a) { return std::isfinite(a); })) used.push_back(i);
    }
    if (used.size() < least) return false;
    auto& sorted = memory.sorted;
    sorted.resize(used.size());
    for (std::size_t r = 0; r < 4; ++r) {
      std::transform(used.begin(), used.end(), sorted.begin(), [&](int i) { return numbers(i)[r]; });
      centre_[r] = median_of(sorted);
    }
    const auto distance = [&](int i) {
      const std::array<double, 4> v = numbers(i);
      double sum = 0;
      for (std::size_t r = 0; r < 4; ++r) sum += (v[r] - centre_[r]) * (v[r] - centre_[r]);
      return std::sqrt(sum);
    };
    std::transform(used.begin(), used.end(), sorted.begin(), distance);
    double spread = median_of(sorted);
    if (!(spread > 0)) {  // more than half in one place
      spread = std::sqrt(std::inner_product(sorted.begin(), sorted.end(), sorted.begin(), 0.0) /
                         static_cast<double>(sorted.size()));
    }
    if (!(spread > 0) || !std::isfinite(spread)) return false;
    const auto out_of_reach = [&](int i) { return !(distance(i) <= kFarthest * spread); };
    used.erase(std::remove_if(used.begin(), used.end(), out_of_reach), used.end());
    if (used.size() < least) return false;
    shuffle(used);
    scale_ = 2 / spread;  // a median square of 2 for each point, as the mean of Hartley's
    n_ = used.size();
    padded_ = padded(n_);
    memory.coarse.assign(4 * padded_, 0.0F);
    memory.fine.resize(kRows * n_ + kMatchBlock);  // whole blocks can be read from any row
    coarse_ = memory.coarse.data();
    fine_ = memory.fine.data();
    for (std::size_t i = 0; i < n_; ++i) {
      std::array<double, 4> values = numbers(used[i]);
      for (std::size_t r = 0; r < 4; ++r) {
        values[r] = scale_ * (values[r] - centre_[r]);
        memory.coarse[r * padded_ + i] = static_cast<float>(values[r]);
        memory.fine[r * n_ + i] = values[r];
      }
      memory.fine[4 * n_ + i] = values[0] * values[0];
      memory.fine[5 * n_ + i] = values[0] * values[1];
      memory.fine[6 * n_ + i] = values[1] * values[1];
      memory.fine[7 * n_ + i] = 1;
    }
    return true;
  }

  [[nodiscard]] std::size_t size() const { return n_; }
  [[nodiscard]] double scale() const { return scale_; }
  [[nodiscard]] Eigen::Vector3d first(std::size_t i) const { return {fine_[i], fine_[n_ + i], 1}; }
  [[nodiscard]] Eigen::Vector3d second(std::size_t i) const {
    return {fine_[2 * n_ + i], fine_[3 * n_ + i], 1};
  }
  /// Both points of a match, homogeneous.
  void copy_points(std::size_t i, double* p, double* q) const {
    p[0] = fine_[i], p[1] = fine_[n_ + i], p[2] = 1;
    q[0] = fine_[2 * n_ + i], q[1] = fine_[3 * n_ + i], q[2] = 1;
  }
  /// Normalised from recorded pixels: of the first and of the second image.
  [[nodiscard]] Eigen::Matrix3d T() const {
    return similarity(scale_, -scale_ * centre_[0], -scale_ * centre_[1]);
  }
  [[nodiscard]] Eigen::Matrix3d T_m() const {
    return similarity(scale_, -scale_ * centre_[2], -scale_ * centre_[3]);
  }
  [[nodiscard]] Eigen::Matrix3d T_m_inverse() const { return similarity(1 / scale_, centre_[2], centre_[3]); }

  /// Row of x, y, x_m, y_m (0 to 3) in double or, filled up with zeros, in float.
  [[nodiscard]] const double* fine(std::size_t r) const { return fine_ + r * n_; }
  [[nodiscard]] const float* coarse(std::size_t r) const { return coarse_ + r * padded_; }
  template <std::floating_point T>
  [[nodiscard]] const T* row(std::size_t r) const {
    if constexpr (std::same_as<T, float>) {
      return coarse(r);
    } else {
      return fine(r);
    }
  }

  /// Sum of weight_i p_i p_i^T over the points of the first `n` matches in the first image, p being
  /// homogeneous.
  [[nodiscard]] Eigen::Matrix3d moments(std::size_t n, const double* weight) const {
    const double xx = dot_rows(n, weight, fine(4)), xy = dot_rows(n, weight, fine(5)),
                 yy = dot_rows(n, weight, fine(6)), x = dot_rows(n, weight, fine(0)),
                 y = dot_rows(n, weight, fine(1)), one = dot_rows(n, weight, fine(7));
    Eigen::Matrix3d M;
    M(0, 0) = xx;
    M(1, 1) = yy;
    M(2, 2) = one;
    M(0, 1) = M(1, 0) = xy;
    M(0, 2) = M(2, 0) = x;
    M(1, 2) = M(2, 1) = y;
    return M;
  }

  /// Sum of value(x, y, x_m, y_m) over the matches: sum_of_worths().
  template <class Value>
  [[nodiscard]] float sum(float beaten, const Value& value) const {
    return sum_of_worths(n_, beaten, [&](std::size_t begin) {
      const float *x = coarse(0) + begin, *y = coarse(1) + begin, *x_m = coarse(2) + begin,
                  *y_m = coarse(3) + begin;
      return [x, y, x_m, y_m, &value](std::size_t i) { return value(x[i], y[i], x_m[i], y_m[i]); };
    });
  }

 private:
  static constexpr std::size_t kRows = 8;
  [[nodiscard]] static Eigen::Matrix3d similarity(double scale, double x, double y) {
    Eigen::Matrix3d T = Eigen::Matrix3d::Identity();
    T(0, 0) = T(1, 1) = scale;
    T(0, 2) = x;
    T(1, 2) = y;
    return T;
  }
  std::size_t n_ = 0, padded_ = 0;
  std::array<double, 4> centre_{};  // of x, y, x_m, y_m
  double scale_ = 1;
  const float* coarse_ = nullptr;
  const double* fine_ = nullptr;
};

// From here on of double alone, and templates all the same: who includes them and does not call them waits
// for no compiler.

/// Row by row in a vector, and back.
template <std::floating_point W>
[[nodiscard]] Eigen::Matrix<W, 9, 1> as_vector(const Eigen::Matrix<W, 3, 3>& m) {
  Eigen::Matrix<W, 9, 1> v;
  for (int i = 0; i < 9; ++i) v[i] = m(i / 3, i % 3);
  return v;
}
template <std::floating_point W>
[[nodiscard]] Eigen::Matrix<W, 3, 3> as_matrix(const Eigen::Matrix<W, 9, 1>& v) {
  Eigen::Matrix<W, 3, 3> m;
  for (int i = 0; i < 9; ++i) m(i / 3, i % 3) = v[i];
  return m;
}
/// Block (i, j) of nine.
template <std::same_as<double> W>
void put_block(Eigen::Matrix<W, 9, 9>& A, Eigen::Index i, Eigen::Index j, const Eigen::Matrix<W, 3, 3>& m) {
  for (int c = 0; c < 3; ++c) {
    for (int r = 0; r < 3; ++r) A(3 * i + r, 3 * j + c) = m(r, c);
  }
}

/// Eigenvector of the smallest eigenvalue by inverse iteration from a vector that is near it; nullopt where
/// the matrix is not positive (semi)definite.
template <std::same_as<double> W>
[[nodiscard]] std::optional<Eigen::Matrix<W, 9, 1>> smallest_eigenvector(Eigen::Matrix<W, 9, 9> A,
                                                                         const Eigen::Matrix<W, 9, 1>& near) {
  A.diagonal().array() += 1e-14 * A.trace();
  SmallCholesky<W, 9> factors;
  if (!factors.compute(A)) return std::nullopt;
  Eigen::Matrix<W, 9, 1> v = near;
  for (int i = 0; i < 6; ++i) {
    Eigen::Matrix<W, 9, 1> next = factors.solve(v);
    next.normalize();
    if (next.dot(v) < 0) next = -next;
    const bool done = (next - v).squaredNorm() < 1e-12;
    v = next;
    if (done) break;
  }
  if (!v.allFinite()) return std::nullopt;
  return v;
}

/// What a match at the share `part` of the squared threshold, a finite number, counts: 1 where it fits, less
/// with the error and nothing from the threshold on (Tukey's biweight). Of a choice, g++ makes branches here
/// and no vectors.
[[nodiscard]] inline float inlier_worth(float part) {
  const float left = 1.0F - part, kept = 0.5F * (left + std::abs(left));
  return kept * kept * kept;
}

}  // namespace dynslam::detail

#include "dynslam/pop_macros.hpp"
