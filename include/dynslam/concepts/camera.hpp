// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <concepts>
#include <optional>

namespace dynslam {

/// A central camera: projects points of the camera frame (z forward, metres) to pixels and back.
template <class C>
concept CameraModel = requires(const C& camera, const Eigen::Matrix<typename C::ScalarType, 3, 1>& p,
                               const Eigen::Matrix<typename C::ScalarType, 2, 1>& x,
                               typename C::ScalarType z) {
  { camera.project(p) } -> std::same_as<std::optional<Eigen::Matrix<typename C::ScalarType, 2, 1>>>;
  { camera.unproject(x, z) } -> std::convertible_to<Eigen::Matrix<typename C::ScalarType, 3, 1>>;
};

}  // namespace dynslam
