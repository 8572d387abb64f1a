// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <cmath>
#include <limits>
#include <type_traits>

#include "dynslam/concepts/scalar.hpp"

namespace dynslam {

namespace detail {
/// F [x; 1].
template <Scalar S>
[[nodiscard]] Eigen::Matrix<S, 3, 1> line_of(const Eigen::Matrix<S, 3, 3>& F,
                                             const Eigen::Matrix<S, 2, 1>& x) {
  return {F(0, 0) * x[0] + F(0, 1) * x[1] + F(0, 2), F(1, 0) * x[0] + F(1, 1) * x[1] + F(1, 2),
          F(2, 0) * x[0] + F(2, 1) * x[1] + F(2, 2)};
}
}  // namespace detail

/// Epipolar line F x in the second image, scaled so that (a, b) is a unit vector: a u + b v + c is a
/// signed distance in pixels. A point at the epipole has no line: the zero vector.
template <Scalar S>
[[nodiscard]] Eigen::Matrix<S, 3, 1> epipolar_line(const Eigen::Matrix<S, 3, 3>& F,
                                                   const std::type_identity_t<Eigen::Matrix<S, 2, 1>>& x) {
  using std::sqrt;
  const Eigen::Matrix<S, 3, 1> line = detail::line_of<S>(F, x);
  const S a = line[0], b = line[1], c = line[2];
  const S norm = sqrt(a * a + b * b);
  if (!(S(0) < norm)) return {S(0), S(0), S(0)};
  return {a / norm, b / norm, c / norm};
}

/// Distance of the match x_m to the epipolar line of x [px] (Eq 8 as a distance).
template <Scalar S>
[[nodiscard]] S line_distance(const Eigen::Matrix<S, 3, 3>& F,
                              const std::type_identity_t<Eigen::Matrix<S, 2, 1>>& x,
                              const std::type_identity_t<Eigen::Matrix<S, 2, 1>>& x_m) {
  using std::abs;
  const Eigen::Matrix<S, 3, 1> line = epipolar_line<S>(F, x);
  return abs(line[0] * x_m[0] + line[1] * x_m[1] + line[2]);
}

/// Sampson's first-order geometric error, squared [px^2]; infinite where its gradient vanishes.
template <Scalar S>
[[nodiscard]] S sampson_distance_squared(const Eigen::Matrix<S, 3, 3>& F,
                                         const std::type_identity_t<Eigen::Matrix<S, 2, 1>>& x,
                                         const std::type_identity_t<Eigen::Matrix<S, 2, 1>>& x_m) {
  const Eigen::Matrix<S, 3, 1> line = detail::line_of<S>(F, x);
  const S a = line[0], b = line[1], c = line[2];
  const S a_m = F(0, 0) * x_m[0] + F(1, 0) * x_m[1] + F(2, 0),
          b_m = F(0, 1) * x_m[0] + F(1, 1) * x_m[1] + F(2, 1);
  const S e = x_m[0] * a + x_m[1] * b + c;
  const S gradient = a * a + b * b + a_m * a_m + b_m * b_m;
  if (!(S(0) < gradient)) return std::numeric_limits<S>::infinity();
  return e * e / gradient;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
