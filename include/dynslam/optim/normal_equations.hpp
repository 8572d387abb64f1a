// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <limits>

#include "dynslam/concepts/scalar.hpp"

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
    damped.diagonal() += lambda * H_.diagonal();
    if (!well_posed(damped)) return false;
    const Eigen::LLT<Matrix, Eigen::Lower> factor(damped);
    if (factor.info() != Eigen::Success) return false;
    delta = factor.solve(-b_);
    return delta.allFinite();
  }

  /// Inverse of H; false where the system does not determine all parameters.
  [[nodiscard]] bool covariance(Matrix& out) const {
    if (!well_posed(H_)) return false;
    const Eigen::LLT<Matrix, Eigen::Lower> factor(H_);
    if (factor.info() != Eigen::Success) return false;
    out = factor.solve(Matrix::Identity());
    return out.allFinite();
  }

  [[nodiscard]] Matrix hessian() const { return H_.template selfadjointView<Eigen::Lower>(); }
  [[nodiscard]] const Vector& gradient() const { return b_; }

 private:
  /// Every pivot of the scaled matrix must stand clear of rounding.
  [[nodiscard]] static bool well_posed(const Matrix& H) {
    const Vector d = H.diagonal();
    if (!(S(0) < d.minCoeff()) || !d.allFinite()) return false;
    const Vector scale = d.cwiseSqrt().cwiseInverse();
    const Matrix scaled =
        scale.asDiagonal() * Matrix(H.template selfadjointView<Eigen::Lower>()) * scale.asDiagonal();
    const Eigen::LDLT<Matrix> factor(scaled);
    return factor.vectorD().minCoeff() > S(10) * Eigen::NumTraits<S>::epsilon();
  }

  Matrix H_ = Matrix::Zero();
  Vector b_ = Vector::Zero();
};

}  // namespace dynslam
