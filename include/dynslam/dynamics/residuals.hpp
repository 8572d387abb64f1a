// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <cmath>
#include <concepts>
#include <optional>

#include "dynslam/concepts/image.hpp"
#include "dynslam/concepts/scalar.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/image/sample.hpp"

namespace dynslam {

/// Eq (3): E_I = I_ref(x) - I_cur(x') in grey values, x' being the projection of x with the present
/// pose. nullopt where either lies outside its image.
template <ImageLike A, FixedMatrix<2> X, ImageLike B, FixedMatrix<2> Y, Scalar S = typename Y::Scalar>
  requires std::same_as<typename X::Scalar, S>
[[nodiscard]] std::optional<S> photometric_residual(const A& reference, const Eigen::MatrixBase<X>& x,
                                                    const B& current,
                                                    const Eigen::MatrixBase<Y>& x_projected) {
  const auto a = bilinear<S>(reference, x.x(), x.y());
  const auto b = bilinear<S>(current, x_projected.x(), x_projected.y());
  if (!a || !b) return std::nullopt;
  return S(*a - *b);
}

/// Eq (5): E_C = |x' - x_m| in pixels, projection against match. It has no derivative where the two coincide.
template <FixedMatrix<2> X, FixedMatrix<2> Y, Scalar S = typename X::Scalar>
  requires std::same_as<typename Y::Scalar, S>
[[nodiscard]] S reprojection_residual(const Eigen::MatrixBase<X>& x_projected,
                                      const Eigen::MatrixBase<Y>& x_m) {
  return (x_projected - x_m).norm();
}

/// Eq (6): E_D = (T_c P)_z - D(x_m) in metres: expected against measured depth at the match (nearest
/// pixel: interpolation across a depth edge would make up a surface). nullopt without valid depth.
template <FixedMatrix<3> P, DepthImage D, FixedMatrix<2> X, Scalar S = typename P::Scalar>
  requires std::same_as<typename X::Scalar, S>
[[nodiscard]] std::optional<S> depth_residual(const Eigen::MatrixBase<P>& p_c, const D& depth,
                                              const Eigen::MatrixBase<X>& x_m) {
  const double u = to_double(x_m.x()), v = to_double(x_m.y());
  if (!(u > -0.5 && v > -0.5 && u < depth.width() - 0.5 && v < depth.height() - 0.5)) return std::nullopt;
  const auto z = depth(static_cast<int>(std::lround(u)), static_cast<int>(std::lround(v)));
  if (!is_valid_depth(z)) return std::nullopt;
  return S(p_c.z() - S(static_cast<double>(z)));
}

/// The three errors of one reference keypoint, each as the functions above return it: an error that is
/// missing is empty, one that is given counts.
template <Scalar S>
struct KeypointResiduals {
  std::optional<S> photometric;  ///< Eq (3) [grey values]; empty: a pixel outside its image
  S reprojection = S(0.0);       ///< Eq (5) [px]
  std::optional<S> depth;        ///< Eq (6) [m]; empty: no valid depth at the match
  /// d of Eq (7): how many errors there are, 1 to 3.
  [[nodiscard]] int dimension() const { return 1 + (photometric ? 1 : 0) + (depth ? 1 : 0); }
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
