// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <limits>
#include <type_traits>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/concepts/scalar.hpp"

namespace dynslam {

/// A known point seen at a pixel, with a measured depth where there is one.
template <Scalar S>
struct PoseObservation {
  Eigen::Matrix<S, 3, 1> p_w;  ///< world [m]
  Eigen::Matrix<S, 2, 1> x;    ///< pixel of the camera that it is used with
  S depth = S(0);              ///< along the optical axis [m]; invalid: reprojection only
  S inv_sigma_px2 = S(1);      ///< 1 / variance of each pixel coordinate [1/px^2]
  S inv_sigma_z2 = S(0);       ///< 1 / variance of the depth [1/m^2]

  PoseObservation() = default;
  /// Without depth, its pixel with a standard deviation of 1 px.
  PoseObservation(const Eigen::Matrix<S, 3, 1>& point, const Eigen::Matrix<S, 2, 1>& pixel)
      : p_w(point), x(pixel) {}
  /// With depth. A depth counts by its accuracy, so that there is no way to give one without the other.
  PoseObservation(const Eigen::Matrix<S, 3, 1>& point, const Eigen::Matrix<S, 2, 1>& pixel, const S& z,
                  const S& pixel_information, const S& depth_information)
      : p_w(point), x(pixel), depth(z), inv_sigma_px2(pixel_information), inv_sigma_z2(depth_information) {}
};

/// One sight of a point: which pose, which point, where, how far.
template <Scalar S>
struct BundleObservation {
  int pose = 0, point = 0;
  Eigen::Matrix<S, 2, 1> x;  ///< pixel of the camera that it is used with
  S depth = S(0);            ///< along the optical axis [m]; invalid: reprojection only
  S inv_sigma_px2 = S(1);    ///< [1/px^2]
  S inv_sigma_z2 = S(0);     ///< [1/m^2]

  BundleObservation() = default;
  /// Without depth, its pixel with a standard deviation of 1 px.
  BundleObservation(int pose_index, int point_index, const Eigen::Matrix<S, 2, 1>& pixel)
      : pose(pose_index), point(point_index), x(pixel) {}
  /// With depth, which counts by its accuracy.
  BundleObservation(int pose_index, int point_index, const Eigen::Matrix<S, 2, 1>& pixel, const S& z,
                    const S& pixel_information, const S& depth_information)
      : pose(pose_index),
        point(point_index),
        x(pixel),
        depth(z),
        inv_sigma_px2(pixel_information),
        inv_sigma_z2(depth_information) {}
};

/// Whether the depth of an observation is known, and how well: both it and its accuracy must be given.
template <Scalar S>
[[nodiscard]] bool measures_depth(const S& depth, const S& inv_sigma_z2) {
  return S(0) < inv_sigma_z2 && S(0) < depth && depth < S(std::numeric_limits<double>::infinity());
}
/// The same for an observation.
template <Scalar S>
[[nodiscard]] bool measures_depth(const PoseObservation<S>& o) {
  return measures_depth(o.depth, o.inv_sigma_z2);
}

namespace detail {
/// p_z - depth; 0 where the depth is no number (NaN is how images say that they have none), so that it may be
/// added with a weight of 0.
template <Scalar S>
[[nodiscard]] S depth_difference(const S& z, const S& depth) {
  return depth - depth == S(0) ? S(z - depth) : S(0);
}
}  // namespace detail

/// Residual [u - x_u, v - x_v, p_z - depth] of the camera-frame point p; the last is 0 where the depth is not
/// finite.
/// @return false when the camera does not see the point
template <Scalar S, CameraOf<S> Camera>
[[nodiscard]] bool point_residual(const Camera& camera, const std::type_identity_t<Eigen::Matrix<S, 3, 1>>& p,
                                  const PoseObservation<S>& o, Eigen::Matrix<S, 3, 1>& r) {
  const auto x = camera.project(p);
  if (!x) return false;
  r = Eigen::Matrix<S, 3, 1>(x->x() - o.x.x(), x->y() - o.x.y(), detail::depth_difference<S>(p.z(), o.depth));
  return true;
}

/// The same with the derivative of the pixel by p.
/// @param dx  out (2 x 3); may be null
template <Scalar S, DifferentiableCameraOf<S> Camera>
[[nodiscard]] bool point_residual(const Camera& camera, const std::type_identity_t<Eigen::Matrix<S, 3, 1>>& p,
                                  const PoseObservation<S>& o, Eigen::Matrix<S, 3, 1>& r,
                                  std::type_identity_t<Eigen::Matrix<S, 2, 3>>* dx) {
  const auto x = camera.project(p, dx);
  if (!x) return false;
  r = Eigen::Matrix<S, 3, 1>(x->x() - o.x.x(), x->y() - o.x.y(), detail::depth_difference<S>(p.z(), o.depth));
  return true;
}

/// Residual of a point of the world under a pose.
/// @param T_c_w  SE3, or its isometry() where many points follow
/// @return false when the camera does not see the point
template <Scalar S, CameraOf<S> Camera, class Transform>
[[nodiscard]] bool pose_residual(const Camera& camera, const Transform& T_c_w, const PoseObservation<S>& o,
                                 Eigen::Matrix<S, 3, 1>& r) {
  const Eigen::Matrix<S, 3, 1> p = T_c_w * o.p_w;
  return point_residual(camera, p, o, r);
}

/// The same with its derivative by the left increment [upsilon; omega] of T_c_w (rows 0-1: Eq 5, row 2:
/// Eq 6).
/// @param J  out (3 x 6); may be null
template <Scalar S, DifferentiableCameraOf<S> Camera, class Transform>
[[nodiscard]] bool pose_residual(const Camera& camera, const Transform& T_c_w, const PoseObservation<S>& o,
                                 Eigen::Matrix<S, 3, 1>& r, std::type_identity_t<Eigen::Matrix<S, 3, 6>>* J) {
  const Eigen::Matrix<S, 3, 1> p = T_c_w * o.p_w;
  Eigen::Matrix<S, 2, 3> dx;
  if (!point_residual(camera, p, o, r, J != nullptr ? &dx : nullptr)) return false;
  if (J != nullptr) {  // d p / d delta = [I, -hat(p)]
    for (int i = 0; i < 3; ++i) {
      const S a = i < 2 ? dx(i, 0) : S(0), b = i < 2 ? dx(i, 1) : S(0), c = i < 2 ? dx(i, 2) : S(1);
      (*J)(i, 0) = a;
      (*J)(i, 1) = b;
      (*J)(i, 2) = c;
      (*J)(i, 3) = c * p.y() - b * p.z();
      (*J)(i, 4) = a * p.z() - c * p.x();
      (*J)(i, 5) = b * p.x() - a * p.y();
    }
  }
  return true;
}

/// Squared normalised error of an observation with the given residual.
template <Scalar S>
[[nodiscard]] S observation_chi2(const PoseObservation<S>& o,
                                 const std::type_identity_t<Eigen::Matrix<S, 3, 1>>& r) {
  const S pixel = o.inv_sigma_px2 * (r.x() * r.x() + r.y() * r.y());
  if (!measures_depth(o)) return pixel;
  return pixel + o.inv_sigma_z2 * r.z() * r.z();
}

/// Squared normalised error of an observation under a pose; infinity where the camera does not see the point.
template <Scalar S, CameraOf<S> Camera, class Transform>
[[nodiscard]] S observation_chi2(const Camera& camera, const Transform& T_c_w, const PoseObservation<S>& o) {
  Eigen::Matrix<S, 3, 1> r;
  if (!pose_residual(camera, T_c_w, o, r)) return S(std::numeric_limits<double>::infinity());
  return observation_chi2(o, r);
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
