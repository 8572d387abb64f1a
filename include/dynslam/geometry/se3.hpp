// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <cmath>

#include "dynslam/geometry/so3.hpp"

namespace dynslam {

/// Rigid motions: p' = R p + t. Tangent [upsilon; omega] (metres, radians); updates are left
/// increments, T <- exp(delta) T. `T_a_b` maps coordinates of frame b to frame a.
template <Scalar S>
class SE3 {
 public:
  using ScalarType = S;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  using Vector6 = Eigen::Matrix<S, 6, 1>;
  using Matrix3 = Eigen::Matrix<S, 3, 3>;
  using Matrix4 = Eigen::Matrix<S, 4, 4>;
  using Matrix6 = Eigen::Matrix<S, 6, 6>;

  SE3() : t_(Vector3::Zero()) {}
  SE3(const SO3<S>& R, const Vector3& t) : R_(R), t_(t) {}
  SE3(const Eigen::Quaternion<S>& q, const Vector3& t) : R_(q), t_(t) {}

  [[nodiscard]] static SE3 exp(const Vector6& xi) {
    const Vector3 w = xi.template tail<3>();
    return SE3(SO3<S>::exp(w), SO3<S>::left_jacobian(w) * xi.template head<3>());
  }
  [[nodiscard]] Vector6 log() const {
    const Vector3 w = R_.log();
    Vector6 xi;
    xi.template head<3>() = SO3<S>::left_jacobian_inverse(w) * t_;
    xi.template tail<3>() = w;
    return xi;
  }

  [[nodiscard]] SE3 inverse() const {
    const SO3<S> R = R_.inverse();
    return SE3(R, -(R * t_));
  }
  [[nodiscard]] SE3 operator*(const SE3& other) const { return SE3(R_ * other.R_, R_ * other.t_ + t_); }
  [[nodiscard]] Vector3 operator*(const Vector3& p) const { return R_ * p + t_; }

  [[nodiscard]] const SO3<S>& so3() const { return R_; }
  [[nodiscard]] const Vector3& translation() const { return t_; }
  [[nodiscard]] Matrix3 rotation_matrix() const { return R_.matrix(); }
  [[nodiscard]] Matrix4 matrix() const {
    Matrix4 m = Matrix4::Identity();
    m.template topLeftCorner<3, 3>() = R_.matrix();
    m.template topRightCorner<3, 1>() = t_;
    return m;
  }
  /// For many points: their product with it takes half the time.
  [[nodiscard]] Eigen::Transform<S, 3, Eigen::Isometry> isometry() const {
    Eigen::Transform<S, 3, Eigen::Isometry> T;
    T.matrix() = matrix();
    return T;
  }
  /// Ad: exp(Ad xi) = T exp(xi) T^-1.
  [[nodiscard]] Matrix6 adjoint() const {
    const Matrix3 R = R_.matrix();
    Matrix6 m;
    m << R, SO3<S>::hat(t_) * R, Matrix3::Zero(), R;
    return m;
  }
  /// Inverse of J_l(xi), where exp(xi + d) ~ exp(J_l(xi) d) exp(xi) (Barfoot, State Estimation for
  /// Robotics, 7.1.5, with the translation first); valid for rotations below 2 pi.
  [[nodiscard]] static Matrix6 left_jacobian_inverse(const Vector6& xi) {
    using std::cos;
    using std::sin;
    using std::sqrt;
    const Vector3 w = xi.template tail<3>();
    const S t2 = w.squaredNorm();
    S b, c, d;  // factors of the quadratic, cubic and quartic terms of Q
    if (t2 < S(1e-2)) {
      b = S(1) / S(6) - t2 / S(120) + t2 * t2 / S(5040);
      c = S(1) / S(24) - t2 / S(720) + t2 * t2 / S(40320);
      d = S(1) / S(120) - t2 / S(2520) + t2 * t2 / S(120960);
    } else {
      const S t = sqrt(t2), t4 = t2 * t2;
      b = (t - sin(t)) / (t2 * t);
      c = (t2 / S(2) + cos(t) - S(1)) / t4;
      d = (t * (S(1) + S(0.5) * cos(t)) - S(1.5) * sin(t)) / (t4 * t);
    }
    const Matrix3 U = SO3<S>::hat(xi.template head<3>()), W = SO3<S>::hat(w);
    const Matrix3 WU = W * U, UW = U * W, WUW = W * UW;
    const Matrix3 Q =
        S(0.5) * U + b * (WU + UW + WUW) + c * (W * WU + UW * W - S(3) * WUW) + d * (WUW * W + W * WUW);
    const Matrix3 J = SO3<S>::left_jacobian_inverse(w);
    Matrix6 m;
    m << J, -J * Q * J, Matrix3::Zero(), J;
    return m;
  }
  template <Scalar T>
  [[nodiscard]] SE3<T> cast() const {
    return SE3<T>(R_.template cast<T>(), t_.template cast<T>());
  }

 private:
  SO3<S> R_;
  Vector3 t_;
};

/// Rigid motions in single precision.
using SE3f = SE3<float>;
/// Rigid motions in double precision.
using SE3d = SE3<double>;

}  // namespace dynslam
