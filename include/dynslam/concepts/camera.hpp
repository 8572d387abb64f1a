// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <concepts>
#include <optional>

#include "dynslam/concepts/scalar.hpp"

namespace dynslam {

/// A central camera: projects points of the camera frame (z forward, metres) to pixels and back.
///
/// `project(p)` is the pixel of a point, nullopt where the camera cannot see it (behind it, outside the
/// lens' field). `unproject(x, z)` is the point of a pixel at the depth z along the optical axis [m], nullopt
/// where no point in front of the camera projects there.
template <class C>
concept CameraModel = Scalar<typename C::ScalarType> &&
    requires(const C& camera, const Eigen::Matrix<typename C::ScalarType, 3, 1>& p,
             const Eigen::Matrix<typename C::ScalarType, 2, 1>& x, const typename C::ScalarType& z) {
  { camera.project(p) } -> std::same_as<std::optional<Eigen::Matrix<typename C::ScalarType, 2, 1>>>;
  { camera.unproject(x, z) } -> std::same_as<std::optional<Eigen::Matrix<typename C::ScalarType, 3, 1>>>;
};

/// A camera that gives the derivative of its projection, as estimators need: `project(p, J)` writes
/// d x / d p (2 x 3, pixels per metre) through the pointer, unless that is null.
template <class C>
concept DifferentiableCamera = CameraModel<C> &&
    requires(const C& camera, const Eigen::Matrix<typename C::ScalarType, 3, 1>& p,
             Eigen::Matrix<typename C::ScalarType, 2, 3>* J) {
  { camera.project(p, J) } -> std::same_as<std::optional<Eigen::Matrix<typename C::ScalarType, 2, 1>>>;
};

/// A camera over the scalar S.
template <class C, class S>
concept CameraOf = CameraModel<C> && std::same_as<typename C::ScalarType, S>;
/// The same with a derivative of its projection.
template <class C, class S>
concept DifferentiableCameraOf = DifferentiableCamera<C> && std::same_as<typename C::ScalarType, S>;

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
