// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>

#include "dynslam/concepts/scalar.hpp"
#include "dynslam/geometry/small_cholesky.hpp"

namespace dynslam {

// Eigen's expressions cost the compiler seconds in every source that estimates a pose, so what is small is
// spelled out, in the order in which Eigen adds.
namespace detail {

template <class S>
[[nodiscard]] bool all_finite(const S* values, Eigen::Index n) {
  for (Eigen::Index i = 0; i < n; ++i) {
    const S difference = values[i] - values[i];
    if (!(difference == S(0))) return false;  // NaN and infinity
  }
  return true;
}

/// Dot product of six numbers, in the order in which Eigen adds pairs of doubles.
template <class S>
[[nodiscard]] S dot6(const S* a, const S* b) {
  return (a[0] * b[0] + (a[2] * b[2] + a[4] * b[4])) + (a[1] * b[1] + (a[3] * b[3] + a[5] * b[5]));
}

/// sum += A [x, y, z]
template <class S, int R>
void add_product(const Eigen::Matrix<S, R, 3>& A, const S x, const S y, const S z, S* sum) {
  for (int i = 0; i < R; ++i) sum[i] += A(i, 0) * x + A(i, 1) * y + A(i, 2) * z;
}

/// diag(scale) A
template <class S, int C>
[[nodiscard]] Eigen::Matrix<S, 3, C> scaled_rows(const Eigen::Matrix<S, 3, 1>& scale,
                                                 const Eigen::Matrix<S, 3, C>& A) {
  Eigen::Matrix<S, 3, C> result;
  for (int j = 0; j < C; ++j) {
    for (int i = 0; i < 3; ++i) result(i, j) = scale(i) * A(i, j);
  }
  return result;
}

/// sum += A^T B
template <class S, int R, int C>
void add_transposed_product(const Eigen::Matrix<S, 3, R>& A, const Eigen::Matrix<S, 3, C>& B,
                            Eigen::Matrix<S, R, C>& sum) {
  Eigen::Matrix<S, R, 3> A_T;  // each column of the sum in one go, for SIMD
  for (int i = 0; i < R; ++i) {
    for (int k = 0; k < 3; ++k) A_T(i, k) = A(k, i);
  }
  for (int j = 0; j < C; ++j) add_product(A_T, B(0, j), B(1, j), B(2, j), sum.data() + R * j);
}

/// A B
template <class S, int C>
[[nodiscard]] Eigen::Matrix<S, 6, C> product6(const Eigen::Matrix<S, 6, 6>& A,
                                              const Eigen::Matrix<S, 6, C>& B) {
  Eigen::Matrix<S, 6, C> result;
  for (int j = 0; j < C; ++j) {
    for (int i = 0; i < 6; ++i) {
      result(i, j) = A(i, 0) * B(0, j) + A(i, 1) * B(1, j) + A(i, 2) * B(2, j) + A(i, 3) * B(3, j) +
                     A(i, 4) * B(4, j) + A(i, 5) * B(5, j);
    }
  }
  return result;
}

/// A^T B
template <class S>
[[nodiscard]] Eigen::Matrix<S, 6, 6> transposed_product6(const Eigen::Matrix<S, 6, 6>& A,
                                                         const Eigen::Matrix<S, 6, 6>& B) {
  Eigen::Matrix<S, 6, 6> result;
  for (int j = 0; j < 6; ++j) {
    for (int i = 0; i < 6; ++i) result(i, j) = dot6(A.data() + 6 * i, B.data() + 6 * j);
  }
  return result;
}

}  // namespace detail

/// Normal equations H delta = -b of weighted least squares with N parameters; only the lower
/// triangle of H is accumulated.
template <Scalar S, int N>
class NormalEquations {
 public:
  using Vector = Eigen::Matrix<S, N, 1>;
  using Matrix = Eigen::Matrix<S, N, N>;

  void set_zero() {
    H_.setZero();
    b_.setZero();
  }

  /// Adds weight * J^T J and weight * J^T r of one scalar residual.
  template <class D>
    requires FixedMatrix<D, 1, N>
  void add_row(const Eigen::MatrixBase<D>& J, const S& r, const S& weight) {
    for (int j = 0; j < N; ++j) {
      const S wj = weight * J(0, j);
      for (int i = j; i < N; ++i) H_(i, j) += wj * J(0, i);
      b_(j) += wj * r;
    }
  }

  /// Takes over a system whose lower triangle was summed elsewhere.
  void assign(const Matrix& H, const Vector& b) {
    H_ = H;
    b_ = b;
  }

  /// Step of the damped system (H + lambda diag H) delta = -b; false where it is not positive definite.
  [[nodiscard]] bool solve(const S& lambda, Vector& delta) const {
    Matrix damped = H_;
    for (int i = 0; i < N; ++i) damped(i, i) += lambda * H_(i, i);
    SmallCholesky<S, N> factor;
    if (!factor.compute(damped)) return false;
    const Vector step = factor.solve(b_);
    for (int i = 0; i < N; ++i) delta(i) = -step(i);
    return detail::all_finite(delta.data(), N);
  }

  /// Inverse of H; false where the system does not determine all parameters.
  [[nodiscard]] bool covariance(Matrix& out) const {
    SmallCholesky<S, N> factor;
    if (!factor.compute(H_)) return false;
    out = factor.inverse();
    return detail::all_finite(out.data(), N * N);
  }

  [[nodiscard]] Matrix hessian() const {
    Matrix H = H_;
    for (int j = 1; j < N; ++j) {
      for (int i = 0; i < j; ++i) H(i, j) = H(j, i);
    }
    return H;
  }
  [[nodiscard]] const Vector& gradient() const { return b_; }

 private:
  Matrix H_ = Matrix::Zero();
  Vector b_ = Vector::Zero();
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
