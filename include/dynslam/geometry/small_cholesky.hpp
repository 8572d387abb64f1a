// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <cmath>
#include <cstddef>

#include "dynslam/concepts/scalar.hpp"

namespace dynslam {

/// Cholesky factorisation A = D L P L^T D of a small symmetric positive definite matrix, D the square roots
/// of its diagonal, L unit lower triangular, P the pivots: the scaling makes the pivots comparable whatever
/// the units of the parameters are (metres beside radians).
///
/// Plain loops over N known at compile time: Eigen's LLT, unrolled by templates, takes as long to run and a
/// third of the compile time of everything that estimates a pose.
template <Scalar S, int N>
class SmallCholesky {
 public:
  using Vector = Eigen::Matrix<S, N, 1>;
  using Matrix = Eigen::Matrix<S, N, N>;

  /// @param A  only its lower triangle is read
  /// @return false where A is not positive definite by more than rounding: some pivot, each 1 for a diagonal
  ///         matrix, is not above 10 epsilon, or a number is not finite. Nothing may be solved then.
  [[nodiscard]] bool compute(const Matrix& A) {
    using std::sqrt;
    for (int i = 0; i < N; ++i) {
      if (!(S(0) < A(i, i) && A(i, i) < Eigen::NumTraits<S>::highest())) return false;
      scale_[i] = S(1) / sqrt(A(i, i));
    }
    for (int j = 0; j < N; ++j) {
      S scaled[kSize];  // column j of L P
      for (int i = j; i < N; ++i) {
        S sum = A(i, j) * scale_[i] * scale_[j];
        for (int k = 0; k < j; ++k) sum -= L_[i][k] * (L_[j][k] * pivot_[k]);
        scaled[i] = sum;
      }
      if (!(S(10) * Eigen::NumTraits<S>::epsilon() < scaled[j])) return false;
      pivot_[j] = scaled[j];
      inverse_pivot_[j] = S(1) / scaled[j];
      for (int i = j + 1; i < N; ++i) L_[i][j] = scaled[i] * inverse_pivot_[j];
    }
    return true;
  }

  /// x of A x = b.
  [[nodiscard]] Vector solve(const Vector& b) const {
    Vector x;
    for (int i = 0; i < N; ++i) {
      S sum = b(i) * scale_[i];
      for (int k = 0; k < i; ++k) sum -= L_[i][k] * x(k);
      x(i) = sum;
    }
    for (int i = N - 1; i >= 0; --i) {
      S sum = x(i) * inverse_pivot_[i];
      for (int k = i + 1; k < N; ++k) sum -= L_[k][i] * x(k);
      x(i) = sum;
    }
    for (int i = 0; i < N; ++i) x(i) *= scale_[i];
    return x;
  }

  /// The inverse of A, symmetric to the last bit.
  [[nodiscard]] Matrix inverse() const {
    Matrix result;
    for (int j = 0; j < N; ++j) {
      Vector unit;
      for (int i = 0; i < N; ++i) unit(i) = S(i == j ? 1 : 0);
      const Vector column = solve(unit);
      for (int i = j; i < N; ++i) {
        result(i, j) = column(i);
        result(j, i) = column(i);
      }
    }
    return result;
  }

 private:
  static constexpr auto kSize = static_cast<std::size_t>(N);
  S L_[kSize][kSize]{};  // strictly lower part; the rest is not used
  S pivot_[kSize]{}, inverse_pivot_[kSize]{}, scale_[kSize]{};
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
