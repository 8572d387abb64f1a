// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <concepts>

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

/// Sums the normal equations of a pose over its observations.
///
/// Row by row (NormalEquations::add_row) most products are repeated: the Jacobian is P [I, -hat(p)] with the
/// derivative P of (u, v, z) by the camera-frame point p, so that J^T W J has the blocks A = P^T W P,
/// B = -A hat(p) and C = hat(p) B.
template <Scalar S>
class PoseEquations {
 public:
  using Vector3 = Eigen::Matrix<S, 3, 1>;

  void set_zero() { *this = PoseEquations(); }

  /// Adds an observation of any camera.
  /// @param dx  derivative of the pixel by p (2 x 3), as point_residual gives it
  /// @param p   camera-frame point
  /// @param r   its residual (point_residual)
  /// @param pixel_weight, depth_weight  of the squares of r's first two components and of the third
  void add(const Eigen::Matrix<S, 2, 3>& dx, const Vector3& p, const Vector3& r, const S& pixel_weight,
           const S& depth_weight) {
    Eigen::Matrix<S, 2, 3> weighted;
    for (int i = 0; i < 3; ++i)
      weighted(0, i) = pixel_weight * dx(0, i), weighted(1, i) = pixel_weight * dx(1, i);
    const auto product = [&](int i, int j) -> S {
      return weighted(0, i) * dx(0, j) + weighted(1, i) * dx(1, j);
    };
    const S a00 = product(0, 0), a01 = product(0, 1), a02 = product(0, 2), a11 = product(1, 1),
            a12 = product(1, 2), a22 = product(2, 2) + depth_weight;
    a01_ += a01;
    const S x = p.x(), y = p.y(), z = p.z();
    Eigen::Matrix<S, 3, 3> B;
    B(0, 0) = a02 * y - a01 * z, B(0, 1) = a00 * z - a02 * x, B(0, 2) = a01 * x - a00 * y;
    B(1, 0) = a12 * y - a11 * z, B(1, 1) = a01 * z - a12 * x, B(1, 2) = a11 * x - a01 * y;
    B(2, 0) = a22 * y - a12 * z, B(2, 1) = a02 * z - a22 * x, B(2, 2) = a12 * x - a02 * y;
    Vector3 force;
    for (int i = 0; i < 3; ++i) force(i) = weighted(0, i) * r.x() + weighted(1, i) * r.y();
    force.z() += depth_weight * r.z();
    add_blocks({a00, a11, a02, a12, a22}, B, force, p);
  }

  /// Adds an observation of a camera with the derivative of a pinhole: the same without products with its
  /// zeros.
  /// @param p  in front of the camera
  template <class Camera>
    requires kHasPinholeJacobian<Camera>
  void add(const Camera& camera, const Vector3& p, const Vector3& r, const S& pixel_weight,
           const S& depth_weight) {
    const S inverse = S(1) / p.z();
    const S a = camera.fx() * inverse, b = camera.fy() * inverse;  // P = [a 0 c; 0 b d; 0 0 1]
    const S c = -a * p.x() * inverse, d = -b * p.y() * inverse;
    const S wa = pixel_weight * a, wb = pixel_weight * b, wc = pixel_weight * c, wd = pixel_weight * d;
    const S a00 = wa * a, a11 = wb * b, a02 = wa * c, a12 = wb * d, a22 = wc * c + wd * d + depth_weight;
    const S x = p.x(), y = p.y(), z = p.z();
    Eigen::Matrix<S, 3, 3> B;
    B(0, 0) = a02 * y, B(0, 1) = a00 * z - a02 * x, B(0, 2) = -a00 * y;
    B(1, 0) = a12 * y - a11 * z, B(1, 1) = -a12 * x, B(1, 2) = a11 * x;
    B(2, 0) = a22 * y - a12 * z, B(2, 1) = a02 * z - a22 * x, B(2, 2) = a12 * x - a02 * y;
    const Vector3 force(wa * r.x(), wb * r.y(), wc * r.x() + wd * r.y() + depth_weight * r.z());
    add_blocks({a00, a11, a02, a12, a22}, B, force, p);
  }

  void store(NormalEquations<S, 6>& system) const {
    Eigen::Matrix<S, 6, 6> H = Eigen::Matrix<S, 6, 6>::Zero();
    H(0, 0) = a_[0];
    H(1, 0) = a01_;
    H(1, 1) = a_[1];
    H(2, 0) = a_[2];
    H(2, 1) = a_[3];
    H(2, 2) = a_[4];
    H(3, 3) = c_[0];
    H(4, 3) = c_[1];
    H(4, 4) = c_[2];
    H(5, 3) = c_[3];
    H(5, 4) = c_[4];
    H(5, 5) = c_[5];
    Eigen::Matrix<S, 6, 1> b;
    for (int i = 0; i < 3; ++i) {
      b(i) = force_(i);
      b(i + 3) = torque_(i);
      for (int j = 0; j < 3; ++j) H(i + 3, j) = B_(j, i);
    }
    system.assign(H, b);
  }

 private:
  void add_blocks(const std::array<S, 5>& a, const Eigen::Matrix<S, 3, 3>& B, const Vector3& force,
                  const Vector3& p) {
    const S x = p.x(), y = p.y(), z = p.z();
    for (std::size_t k = 0; k < a.size(); ++k) a_[k] += a[k];
    for (int k = 0; k < 9; ++k) B_.data()[k] += B.data()[k];
    c_[0] += y * B(2, 0) - z * B(1, 0);
    c_[1] += z * B(0, 0) - x * B(2, 0);
    c_[2] += z * B(0, 1) - x * B(2, 1);
    c_[3] += x * B(1, 0) - y * B(0, 0);
    c_[4] += x * B(1, 1) - y * B(0, 1);
    c_[5] += x * B(1, 2) - y * B(0, 2);
    for (int i = 0; i < 3; ++i) force_(i) += force(i);
    torque_(0) += y * force.z() - z * force.y();
    torque_(1) += z * force.x() - x * force.z();
    torque_(2) += x * force.y() - y * force.x();
  }

  std::array<S, 5> a_{S(0), S(0), S(0), S(0), S(0)};  // A: 00, 11, 02, 12, 22
  S a01_ = S(0);                                      // zero for a pinhole
  Eigen::Matrix<S, 3, 3> B_ = Eigen::Matrix<S, 3, 3>::Zero();
  std::array<S, 6> c_{S(0), S(0), S(0), S(0), S(0), S(0)};  // C: 00, 10, 11, 20, 21, 22
  Vector3 force_ = Vector3::Zero(), torque_ = Vector3::Zero();
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
  void add_to(PoseEquations<S>& sums, const Camera&, const S& pixel_weight, const S& depth_weight) const {
    sums.add(dx, p, r, pixel_weight, depth_weight);
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
  void add_to(PoseEquations<S>& sums, const Camera& camera, const S& pixel_weight,
              const S& depth_weight) const {
    sums.add(camera, p, r, pixel_weight, depth_weight);
  }
};

}  // namespace dynslam
