// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <type_traits>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/concepts/scalar.hpp"
#include "dynslam/geometry/so3.hpp"

namespace dynslam {

/// The direction in which a recorded pixel looks, and how the two change with each other. Epipolar geometry
/// in these is that of the sphere: it holds through any lens and at any angle, and what is small in it is
/// measured in recorded pixels, in the plane that touches the sphere at the ray.
template <Scalar S>
struct PixelRay {
  Eigen::Matrix<S, 3, 1> ray;        ///< unit vector in the camera's frame
  Eigen::Matrix<S, 2, 3> J;          ///< derivative of the pixel by the ray [px]; J ray = 0
  Eigen::Matrix<S, 3, 2> per_pixel;  ///< derivative of the ray by the pixel [1/px], the pseudo-inverse of J
};

/// The ray to a point of the camera's frame, of any length but 0.
/// @return nullopt where the camera does not see the point, or where its pixel does not determine the ray
template <DifferentiableCamera C>
[[nodiscard]] std::optional<PixelRay<typename C::ScalarType>> pixel_ray(
    const C& camera, const Eigen::Matrix<typename C::ScalarType, 3, 1>& p) {
  using S = typename C::ScalarType;
  using std::abs;
  using std::sqrt;
  PixelRay<S> result;
  Eigen::Matrix<S, 2, 3> J = Eigen::Matrix<S, 2, 3>::Zero();
  if (!camera.project(p, &J)) return std::nullopt;
  // Whatever sees the point sees each point of its ray; its derivative is in proportion to 1 / distance.
  S largest = abs(p[0]);
  for (int k = 1; k < 3; ++k) largest = largest < abs(p[k]) ? S(abs(p[k])) : largest;
  const S x = p[0] / largest, y = p[1] / largest, z = p[2] / largest, length = sqrt(x * x + y * y + z * z),
          distance = largest * length;
  result.ray = Eigen::Matrix<S, 3, 1>(x / length, y / length, z / length);
  for (int i = 0; i < 6; ++i) result.J.data()[i] = distance * J.data()[i];
  S steepest = abs(J(0, 0));
  for (int i = 1; i < 6; ++i) steepest = steepest < abs(J.data()[i]) ? S(abs(J.data()[i])) : steepest;
  for (int i = 0; i < 6; ++i) J.data()[i] /= steepest;  // squares of what is far outside would not be numbers
  S a = S(0), b = S(0), c = S(0);                       // of J J^T
  for (int k = 0; k < 3; ++k) {
    a += J(0, k) * J(0, k);
    b += J(0, k) * J(1, k);
    c += J(1, k) * J(1, k);
  }
  const S size = (a * c - b * b) * (distance * steepest);
  for (int k = 0; k < 3; ++k) {
    result.per_pixel(k, 0) = (c * J(0, k) - b * J(1, k)) / size;
    result.per_pixel(k, 1) = (a * J(1, k) - b * J(0, k)) / size;
  }
  for (int k = 0; k < 3; ++k) {
    const double sum =
        to_double(result.ray[k]) + to_double(result.per_pixel(k, 0)) + to_double(result.per_pixel(k, 1));
    if (!std::isfinite(sum)) return std::nullopt;
  }
  return result;
}

/// The ray of a recorded pixel. @return nullopt where the camera has none
template <DifferentiableCamera C>
[[nodiscard]] std::optional<PixelRay<typename C::ScalarType>> pixel_ray_at(
    const C& camera, const Eigen::Matrix<typename C::ScalarType, 2, 1>& x) {
  const auto p = camera.unproject(x, typename C::ScalarType(1));
  return p ? pixel_ray(camera, *p) : std::nullopt;
}

namespace detail {
/// |per_pixel^T v|^2: what the product of v and a ray changes by where its pixel moves by 1.
template <Scalar S>
[[nodiscard]] S squared_slope(const PixelRay<S>& at, const Eigen::Matrix<S, 3, 1>& v) {
  const auto& A = at.per_pixel;
  const S a = A(0, 0) * v[0] + A(1, 0) * v[1] + A(2, 0) * v[2],
          b = A(0, 1) * v[0] + A(1, 1) * v[1] + A(2, 1) * v[2];
  return a * a + b * b;
}
template <Scalar S>
[[nodiscard]] S dot3(const Eigen::Matrix<S, 3, 1>& a, const Eigen::Matrix<S, 3, 1>& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
}  // namespace detail

/// Distance of a match to the epipolar curve of x in the present image as recorded, to first order [px] (Eq
/// 8); 0 where x has none, at the epipole. Through a pinhole, whose curves are lines, it is line_distance()
/// of F.
/// @param E  essential matrix, or another with ray_m^T E ray = 0
template <Scalar S>
[[nodiscard]] S epipolar_distance(const Eigen::Matrix<S, 3, 3>& E, const PixelRay<S>& x,
                                  const PixelRay<S>& x_m) {
  using std::abs;
  using std::sqrt;
  const Eigen::Matrix<S, 3, 1> line = detail::product<S>(E, x.ray);
  const S slope = detail::squared_slope<S>(x_m, line);
  if (!(S(0) < slope)) return S(0);
  return abs(detail::dot3<S>(x_m.ray, line)) / sqrt(slope);
}

/// Sampson's first-order error of a match with noise in both images as recorded, squared [px^2]; infinite
/// where its gradient vanishes.
/// @param E  as of epipolar_distance()
template <Scalar S>
[[nodiscard]] S sampson_distance_squared(const Eigen::Matrix<S, 3, 3>& E, const PixelRay<S>& x,
                                         const PixelRay<S>& x_m) {
  const Eigen::Matrix<S, 3, 3> E_T = E.transpose();
  const Eigen::Matrix<S, 3, 1> line = detail::product<S>(E, x.ray), line_m = detail::product<S>(E_T, x_m.ray);
  const S e = detail::dot3<S>(x_m.ray, line);
  const S gradient = detail::squared_slope<S>(x_m, line) + detail::squared_slope<S>(x, line_m);
  if (!(S(0) < gradient)) return S(std::numeric_limits<double>::infinity());
  return e * e / gradient;
}

/// Transfer error of a match in the present image as recorded, to first order, squared [px^2]; infinite where
/// H ray is 90 degrees or more from the match.
/// @param H  of rays: ray_m ~ H ray with a positive factor (a plane's, a rotation)
template <Scalar S>
[[nodiscard]] S transfer_distance_squared(const Eigen::Matrix<S, 3, 3>& H, const PixelRay<S>& x,
                                          const PixelRay<S>& x_m) {
  const Eigen::Matrix<S, 3, 1> there = detail::product<S>(H, x.ray);
  const S along = detail::dot3<S>(x_m.ray, there);
  if (!(S(0) < along)) return S(std::numeric_limits<double>::infinity());
  S sum = S(0);
  for (int i = 0; i < 2; ++i) {
    const S d = (x_m.J(i, 0) * there[0] + x_m.J(i, 1) * there[1] + x_m.J(i, 2) * there[2]) / along;
    sum += d * d;
  }
  return sum;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
