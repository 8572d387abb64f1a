// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <concepts>
#include <optional>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/geometry/pinhole.hpp"

namespace dynslam {

/// A camera that names the pinhole behind its lens.
template <class C>
concept HasPinhole = CameraModel<C> && requires(const C& camera) {
  { camera.pinhole() } -> std::convertible_to<Pinhole<typename C::ScalarType>>;
};

/// A camera of which an ideal pinhole is known: it names one, or its derivative on the axis tells one.
template <class C>
concept HasIdealPinhole = HasPinhole<C> || DifferentiableCamera<C>;

/// The ideal pinhole camera of any camera: itself, the one that it names (`pinhole()`), or else the one that
/// agrees with it on the optical axis in value and derivative. What is done in straight lines (epipolar
/// geometry, homographies, grids of rays) is done in the pixels of this camera.
template <HasIdealPinhole C>
[[nodiscard]] Pinhole<typename C::ScalarType> ideal_pinhole(const C& camera) {
  using S = typename C::ScalarType;
  if constexpr (std::same_as<C, Pinhole<S>>) {
    return camera;
  } else if constexpr (HasPinhole<C>) {
    return camera.pinhole();
  } else {
    Eigen::Matrix<S, 2, 3> J = Eigen::Matrix<S, 2, 3>::Zero();  // g++ does not see that project() fills it
    const auto centre = camera.project(Eigen::Matrix<S, 3, 1>(S(0), S(0), S(1)), &J);
    if (!centre) return Pinhole<S>();  // a camera that does not see straight ahead
    return Pinhole<S>(J(0, 0), J(1, 1), centre->x(), centre->y());
  }
}

/// Recorded pixel of the camera to pixel of an ideal pinhole camera at the same place; nullopt where the
/// camera has no ray or the pinhole does not see it (90 degrees and more).
template <CameraModel C>
[[nodiscard]] std::optional<Eigen::Matrix<typename C::ScalarType, 2, 1>> to_ideal(
    const C& camera, const Pinhole<typename C::ScalarType>& pinhole,
    const Eigen::Matrix<typename C::ScalarType, 2, 1>& x) {
  using S = typename C::ScalarType;
  if constexpr (std::same_as<C, Pinhole<S>>) {
    if (camera == pinhole) return x;
  } else if constexpr (HasPinhole<C> && requires { camera.undistort_pixel(x); }) {
    if (camera.pinhole() == pinhole) return camera.undistort_pixel(x);
  }
  const auto p = camera.unproject(x, S(1));
  if (!p) return std::nullopt;
  return pinhole.project(*p);
}

/// Pixel of an ideal pinhole camera to recorded pixel of the camera; nullopt outside the camera's field.
template <CameraModel C>
[[nodiscard]] std::optional<Eigen::Matrix<typename C::ScalarType, 2, 1>> from_ideal(
    const C& camera, const Pinhole<typename C::ScalarType>& pinhole,
    const Eigen::Matrix<typename C::ScalarType, 2, 1>& x) {
  using S = typename C::ScalarType;
  if constexpr (std::same_as<C, Pinhole<S>>) {
    if (camera == pinhole) return x;
  } else if constexpr (HasPinhole<C> && requires { camera.distort_pixel(x); }) {
    if (camera.pinhole() == pinhole) return camera.distort_pixel(x);
  }
  return camera.project(pinhole.ray(x));
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
