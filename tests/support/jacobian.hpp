// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace dynslam::test {

/// Derivative of f at x by central differences, in double (float differences are good to 4e-4 only).
template <int R, int C, class F>
Eigen::Matrix<double, R, C> central_differences(F&& f, const Eigen::Matrix<double, C, 1>& x,
                                                double h = 1e-6) {
  Eigen::Matrix<double, R, C> J;
  for (int i = 0; i < C; ++i) {
    Eigen::Matrix<double, C, 1> a = x, b = x;
    a(i) += h;
    b(i) -= h;
    J.col(i) = (f(a) - f(b)) / (2 * h);
  }
  return J;
}

/// Largest difference of two Jacobians relative to their size.
template <class A, class B>
double relative_error(const Eigen::MatrixBase<A>& analytic, const Eigen::MatrixBase<B>& numeric) {
  return (analytic - numeric).template lpNorm<Eigen::Infinity>() /
         (1.0 + numeric.template lpNorm<Eigen::Infinity>());
}

}  // namespace dynslam::test
