// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "dynslam/concepts/scalar.hpp"
#include "dynslam/optim/small_cholesky.hpp"

namespace dynslam {

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
    return finite(delta.data(), N);
  }

  /// Inverse of H; false where the system does not determine all parameters.
  [[nodiscard]] bool covariance(Matrix& out) const {
    SmallCholesky<S, N> factor;
    if (!factor.compute(H_)) return false;
    out = factor.inverse();
    return finite(out.data(), N * N);
  }

  [[nodiscard]] Matrix hessian() const { return H_.template selfadjointView<Eigen::Lower>(); }
  [[nodiscard]] const Vector& gradient() const { return b_; }

 private:
  [[nodiscard]] static bool finite(const S* values, int n) {
    for (int i = 0; i < n; ++i) {
      const S difference = values[i] - values[i];
      if (!(difference == S(0))) return false;  // NaN and infinity
    }
    return true;
  }

  Matrix H_ = Matrix::Zero();
  Vector b_ = Vector::Zero();
};

}  // namespace dynslam
