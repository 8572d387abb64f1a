// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <cmath>
#include <concepts>

namespace dynslam {

namespace detail {
namespace math {
using std::abs;
using std::exp;
using std::log;
using std::sqrt;
/// Built-in types by the using-declarations, dual numbers by argument-dependent lookup.
template <class T>
concept HasRealMath = requires(const T x) {
  T(abs(x));
  T(exp(x));
  T(log(x));
  T(sqrt(x));
};
}  // namespace math

template <class D>
void as_matrix_base(const Eigen::MatrixBase<D>&);  // accepts VectorBlock too
}  // namespace detail

/// A real number type: float, double or an automatic-differentiation type; never an integer.
template <class T>
concept Scalar = !std::integral<T> && std::copyable<T> && std::constructible_from<T, double> &&
                 detail::math::HasRealMath<T> && requires(const T a, const T b) {
  T(a + b);
  T(a - b);
  T(a * b);
  T(a / b);
  T(-a);
  { a < b } -> std::convertible_to<bool>;
};

/// The plain number in a scalar, without its derivatives, for decisions that cannot be differentiated (which
/// pixel, which branch, whether something is finite). Eigen::AutoDiffScalar and ceres::Jet are known; for
/// another type declare `double scalar_value(const T&)` in its namespace.
template <class T>
[[nodiscard]] constexpr double to_double(const T& x) {
  if constexpr (std::floating_point<T>) {
    return static_cast<double>(x);
  } else if constexpr (requires {
                         { scalar_value(x) } -> std::convertible_to<double>;
                       }) {
    return scalar_value(x);
  } else if constexpr (requires { x.derivatives(); }) {
    return to_double(x.value());  // Eigen::AutoDiffScalar, also of dual numbers
  } else if constexpr (requires {
                         x.a;
                         x.v;
                       }) {
    return to_double(x.a);  // ceres::Jet
  } else {
    return static_cast<double>(x);
  }
}

/// An Eigen expression of the fixed shape R x C.
template <class D, int R, int C = 1>
concept FixedMatrix = requires(const D& d) {
  detail::as_matrix_base(d);
}
&&int(D::RowsAtCompileTime) == R&& int(D::ColsAtCompileTime) == C;

static_assert(Scalar<float> && Scalar<double> && !Scalar<int>);
static_assert(FixedMatrix<Eigen::Vector3d, 3> && !FixedMatrix<Eigen::VectorXd, 3>);

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
