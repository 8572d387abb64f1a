// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

namespace dynslam {

/// A symmetric positive definite matrix of which each row knows its next `Band` neighbours alone, and the
/// linear system with it: what a chain of unknowns makes of least squares. All is linear in its size.
template <std::floating_point S, std::size_t Band>
class BandedSystem {
 public:
  /// Makes it n x n and zero.
  void reset(std::size_t n) { rows_.assign(n, {}); }
  [[nodiscard]] std::size_t size() const { return rows_.size(); }

  /// Element (i + k, i), k <= Band, i + k < size().
  [[nodiscard]] S& at(std::size_t i, std::size_t k) { return rows_[i][k]; }

  /// Takes the matrix apart into L D L^T, in its place.
  /// @return false where it is not positive definite by more than rounding: some pivot is not above 10
  /// epsilon
  ///         of the element it was on the diagonal, or a number is not finite. Nothing may be solved then.
  [[nodiscard]] bool factor() {
    const std::size_t n = rows_.size();
    diagonal_.resize(n);
    for (std::size_t i = 0; i < n; ++i) diagonal_[i] = rows_[i][0];
    for (std::size_t i = 0; i < n; ++i) {
      Row& row = rows_[i];
      const S least = S(10) * std::numeric_limits<S>::epsilon() * diagonal_[i];
      if (!(diagonal_[i] > S(0) && row[0] > least && row[0] <= std::numeric_limits<S>::max())) return false;
      for (std::size_t j = 1; j <= Band && i + j < n; ++j) {
        const S l = row[j] / row[0];
        for (std::size_t k = j; k <= Band && i + k < n; ++k) rows_[i + j][k - j] -= l * row[k];
      }
      for (std::size_t j = 1; j <= Band; ++j) row[j] /= row[0];
    }
    return true;
  }

  /// Solves with the factors. @param x  the right side, and the solution afterwards
  void solve(std::span<S> x) const {
    const std::size_t n = rows_.size();
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t k = 1; k <= Band && i + k < n; ++k) x[i + k] -= rows_[i][k] * x[i];
    }
    for (std::size_t i = n; i-- > 0;) {
      x[i] /= rows_[i][0];
      for (std::size_t k = 1; k <= Band && i + k < n; ++k) x[i] -= rows_[i][k] * x[i + k];
    }
  }

  /// The diagonal of the inverse, from the factors (Takahashi et al. 1973: the part of the inverse within the
  /// band needs no other).
  /// @param out  size() values
  void inverse_diagonal(std::span<S> out) {
    const std::size_t n = rows_.size();
    inverse_.assign(n, {});
    for (std::size_t i = n; i-- > 0;) {
      const std::size_t last = std::min(Band, n - 1 - i);
      // Z_ij = [i == j] / D_i - sum_k L_ki Z_kj, Z symmetric; those to the right of the diagonal come first.
      for (std::size_t j = 1; j <= last; ++j) {
        S sum = S(0);
        for (std::size_t k = 1; k <= last; ++k)
          sum -= rows_[i][k] * inverse_[i + std::min(j, k)][j > k ? j - k : k - j];
        inverse_[i][j] = sum;
      }
      inverse_[i][0] = S(1) / rows_[i][0];
      for (std::size_t k = 1; k <= last; ++k) inverse_[i][0] -= rows_[i][k] * inverse_[i][k];
      out[i] = inverse_[i][0];
    }
  }

 private:
  using Row = std::array<S, Band + 1>;
  std::vector<Row> rows_, inverse_;
  std::vector<S> diagonal_;
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
