// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <concepts>

#include "dynslam/concepts/scalar.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/optim/pose.hpp"

namespace dynslam {

/// One keypoint. Single precision, whatever the scalar of the geometry: 24 bits hold a pixel of any sensor to
/// less than a thousandth, and keyframes keep a thousand of these each.
///
/// `u, v` are pixels of the image as recorded. `x, y` are the same point in the camera that the geometry is
/// calculated with: behind a lens the ideal pinhole (to_ideal), or again `u, v` where the camera model with
/// its lens is used throughout.
struct Feature {
  float u = 0, v = 0;
  float x = 0, y = 0;
  float depth = 0;  ///< metres along the optical axis; <= 0: none
  float angle = 0;  ///< degrees, intensity-centroid orientation
  int octave = 0;
  float sigma = 1;  ///< standard deviation of x and y [px]
};

/// What a feature that shows the point `p_w` tells of the camera's pose (Eqs 5 and 6).
/// @param p_w  world [m]
template <FixedMatrix<3> D>
[[nodiscard]] PoseObservation<typename D::Scalar> observe(const Feature& f, const Eigen::MatrixBase<D>& p_w,
                                                          const DepthNoise<typename D::Scalar>& noise) {
  using S = typename D::Scalar;
  const auto sigma = static_cast<S>(f.sigma), z = static_cast<S>(f.depth);
  return {p_w, Eigen::Matrix<S, 2, 1>(static_cast<S>(f.x), static_cast<S>(f.y)), z, S(1) / (sigma * sigma),
          f.depth > 0 ? noise.information(z) : S(0)};
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
