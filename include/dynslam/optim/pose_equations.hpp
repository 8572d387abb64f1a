// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <array>
#include <concepts>
#include <cstddef>

#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/optim/normal_equations.hpp"
#include "dynslam/optim/pose_residual.hpp"

namespace dynslam {

/// Whether the derivative of a camera's projection is that of a pinhole with its fx() and fy(). Where it is,
/// half of it is zero and the rest is cheaper to form anew than to fetch.
template <class C>
inline constexpr bool kHasPinholeJacobian = false;
template <Scalar S>
inline constexpr bool kHasPinholeJacobian<Pinhole<S>> = true;

/// What one observation adds to the normal equations of a pose.
///
/// Row by row (NormalEquations::add_row) most products are repeated: the Jacobian is P [I, -hat(p)] with the
/// derivative P of (u, v, z) by the camera-frame point p, so that J^T W J has the blocks A = P^T W P,
/// B = -A hat(p) and C = hat(p) B. They lie in one row of numbers, those of the turn behind those of the
/// shift, so that they are added several at once.
template <Scalar S>
struct PoseTerms {
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  static constexpr std::size_t kA = 0, kForce = 6, kB = 9, kC = 18, kTorque = 24, kCount = 27;

  std::array<S, kCount> value;  ///< A: 00, 11, 22, 20, 21, 10; P^T W r; B by rows; C: 00, 10, 11, 20, 21,
                                ///< 22; the gradient of the turn

  /// Of any camera.
  /// @param dx  derivative of the pixel by p (2 x 3), as point_residual gives it
  /// @param p   camera-frame point
  /// @param r   its residual (point_residual)
  /// @param pixel_weight, depth_weight  of the squares of r's first two components and of the third
  PoseTerms(const Eigen::Matrix<S, 2, 3>& dx, const Vector3& p, const Vector3& r, const S& pixel_weight,
            const S& depth_weight) {
    Eigen::Matrix<S, 2, 3> weighted;
    for (int i = 0; i < 3; ++i)
      weighted(0, i) = pixel_weight * dx(0, i), weighted(1, i) = pixel_weight * dx(1, i);
    const auto product = [&](int i, int j) -> S {
      return weighted(0, i) * dx(0, j) + weighted(1, i) * dx(1, j);
    };
    const S a00 = product(0, 0), a01 = product(0, 1), a02 = product(0, 2), a11 = product(1, 1),
            a12 = product(1, 2), a22 = product(2, 2) + depth_weight;
    const S x = p.x(), y = p.y(), z = p.z();
    Vector3 force;
    for (int i = 0; i < 3; ++i) force(i) = weighted(0, i) * r.x() + weighted(1, i) * r.y();
    force.z() += depth_weight * r.z();
    set({a00, a11, a22, a02, a12, a01},
        {a02 * y - a01 * z, a00 * z - a02 * x, a01 * x - a00 * y,  //
         a12 * y - a11 * z, a01 * z - a12 * x, a11 * x - a01 * y,  //
         a22 * y - a12 * z, a02 * z - a22 * x, a12 * x - a02 * y},
        force, p);
  }

  /// Of a camera with the derivative of a pinhole: the same without products with its zeros.
  /// @param p  in front of the camera
  template <class Camera>
    requires kHasPinholeJacobian<Camera>
  PoseTerms(const Camera& camera, const Vector3& p, const Vector3& r, const S& pixel_weight,
            const S& depth_weight) {
    const S inverse = S(1) / p.z();
    const S a = camera.fx() * inverse, b = camera.fy() * inverse;  // P = [a 0 c; 0 b d; 0 0 1]
    const S c = -a * p.x() * inverse, d = -b * p.y() * inverse;
    const S wa = pixel_weight * a, wb = pixel_weight * b, wc = pixel_weight * c, wd = pixel_weight * d;
    const S a00 = wa * a, a11 = wb * b, a02 = wa * c, a12 = wb * d, a22 = wc * c + wd * d + depth_weight;
    const S x = p.x(), y = p.y(), z = p.z();
    set({a00, a11, a22, a02, a12, S(0)},
        {a02 * y, a00 * z - a02 * x, -a00 * y,  //
         a12 * y - a11 * z, -a12 * x, a11 * x,  //
         a22 * y - a12 * z, a02 * z - a22 * x, a12 * x - a02 * y},
        Vector3(wa * r.x(), wb * r.y(), wc * r.x() + wd * r.y() + depth_weight * r.z()), p);
  }

 private:
  void set(const std::array<S, 6>& a, const std::array<S, 9>& b, const Vector3& force, const Vector3& p) {
    const S x = p.x(), y = p.y(), z = p.z();
    for (std::size_t k = 0; k < a.size(); ++k) value[kA + k] = a[k];
    for (std::size_t k = 0; k < 3; ++k) value[kForce + k] = force(static_cast<int>(k));
    for (std::size_t k = 0; k < b.size(); ++k) value[kB + k] = b[k];
    value[kC] = y * b[6] - z * b[3];
    value[kC + 1] = z * b[0] - x * b[6];
    value[kC + 2] = z * b[1] - x * b[7];
    value[kC + 3] = x * b[3] - y * b[0];
    value[kC + 4] = x * b[4] - y * b[1];
    value[kC + 5] = x * b[5] - y * b[2];
    value[kTorque] = y * force.z() - z * force.y();
    value[kTorque + 1] = z * force.x() - x * force.z();
    value[kTorque + 2] = x * force.y() - y * force.x();
  }
};

/// Sums the normal equations of a pose over its observations.
template <Scalar S>
class PoseEquations {
 public:
  using Terms = PoseTerms<S>;

  PoseEquations() { sum_.fill(S(0)); }
  void set_zero() { sum_.fill(S(0)); }

  void add(const Terms& terms) {
    for (std::size_t k = 0; k < Terms::kCount; ++k) sum_[k] += terms.value[k];
  }

  void store(NormalEquations<S, 6>& system) const {
    Eigen::Matrix<S, 6, 6> H = Eigen::Matrix<S, 6, 6>::Zero();
    Eigen::Matrix<S, 6, 1> b;
    store(H, b);
    system.assign(H, b);
  }
  /// @param H  out: the lower triangle of its first six rows
  /// @param b  out: its first six
  template <class Matrix, class Vector>
  void store(Matrix& H, Vector& b) const {
    H(0, 0) = sum_[Terms::kA];
    H(1, 1) = sum_[Terms::kA + 1];
    H(2, 2) = sum_[Terms::kA + 2];
    H(2, 0) = sum_[Terms::kA + 3];
    H(2, 1) = sum_[Terms::kA + 4];
    H(1, 0) = sum_[Terms::kA + 5];
    for (int i = 0; i < 3; ++i) {
      b(i) = sum_[Terms::kForce + static_cast<std::size_t>(i)];
      b(i + 3) = sum_[Terms::kTorque + static_cast<std::size_t>(i)];
      for (int j = 0; j < 3; ++j) H(i + 3, j) = sum_[Terms::kB + static_cast<std::size_t>(3 * j + i)];
    }
    std::size_t k = Terms::kC;
    for (int i = 3; i < 6; ++i) {
      for (int j = 3; j <= i; ++j) H(i, j) = sum_[k++];
    }
  }

 private:
  std::array<S, Terms::kCount> sum_;
};

/// Residual of a camera-frame point, and what PoseEquations needs of its derivative.
template <DifferentiableCamera Camera>
struct PointLinearisation {
  using S = typename Camera::ScalarType;
  Eigen::Matrix<S, 3, 1> p = Eigen::Matrix<S, 3, 1>::Zero(), r = p;
  Eigen::Matrix<S, 2, 3> dx = Eigen::Matrix<S, 2, 3>::Zero();

  /// @return false when the camera does not see the point
  [[nodiscard]] bool at(const Camera& camera, const Eigen::Matrix<S, 3, 1>& p_c,
                        const PoseObservation<S>& o) {
    p = p_c;
    return point_residual(camera, p, o, r, &dx);
  }
  [[nodiscard]] PoseTerms<S> terms(const Camera&, const S& pixel_weight, const S& depth_weight) const {
    return {dx, p, r, pixel_weight, depth_weight};
  }
};

template <DifferentiableCamera Camera>
  requires kHasPinholeJacobian<Camera>
struct PointLinearisation<Camera> {
  using S = typename Camera::ScalarType;
  Eigen::Matrix<S, 3, 1> p = Eigen::Matrix<S, 3, 1>::Zero(), r = p;

  [[nodiscard]] bool at(const Camera& camera, const Eigen::Matrix<S, 3, 1>& p_c,
                        const PoseObservation<S>& o) {
    p = p_c;
    return point_residual(camera, p, o, r);
  }
  [[nodiscard]] PoseTerms<S> terms(const Camera& camera, const S& pixel_weight, const S& depth_weight) const {
    return {camera, p, r, pixel_weight, depth_weight};
  }
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
