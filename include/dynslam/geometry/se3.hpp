// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

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
    const Vector3 upsilon(xi[0], xi[1], xi[2]), w(xi[3], xi[4], xi[5]);
    return SE3(SO3<S>::exp(w), detail::product<S>(SO3<S>::left_jacobian(w), upsilon));
  }
  [[nodiscard]] Vector6 log() const {
    const Vector3 w = R_.log();
    const Vector3 upsilon = detail::product<S>(SO3<S>::left_jacobian_inverse(w), t_);
    Vector6 xi;
    for (int i = 0; i < 3; ++i) xi[i] = upsilon[i], xi[i + 3] = w[i];
    return xi;
  }

  [[nodiscard]] SE3 inverse() const {
    const SO3<S> R = R_.inverse();
    const Vector3 t = R * t_;
    return SE3(R, Vector3(-t[0], -t[1], -t[2]));
  }
  [[nodiscard]] SE3 operator*(const SE3& other) const { return SE3(R_ * other.R_, *this * other.t_); }
  [[nodiscard]] Vector3 operator*(const Vector3& p) const {
    const Vector3 r = R_ * p;
    return Vector3(r[0] + t_[0], r[1] + t_[1], r[2] + t_[2]);
  }

  [[nodiscard]] const SO3<S>& so3() const { return R_; }
  [[nodiscard]] const Vector3& translation() const { return t_; }
  [[nodiscard]] Matrix3 rotation_matrix() const { return R_.matrix(); }
  [[nodiscard]] Matrix4 matrix() const {
    const Matrix3 R = R_.matrix();
    Matrix4 m;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) m(i, j) = R(i, j);
      m(i, 3) = t_[i];
      m(3, i) = S(0);
    }
    m(3, 3) = S(1);
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
    return upper_blocks(R, detail::product<S>(SO3<S>::hat(t_), R));
  }
  /// Inverse of J_l(xi), where exp(xi + d) ~ exp(J_l(xi) d) exp(xi) (Barfoot, State Estimation for
  /// Robotics, 7.1.5, with the translation first); valid for rotations below 2 pi.
  [[nodiscard]] static Matrix6 left_jacobian_inverse(const Vector6& xi) {
    using std::cos;
    using std::sin;
    using std::sqrt;
    const Vector3 upsilon(xi[0], xi[1], xi[2]), w(xi[3], xi[4], xi[5]);
    const S t2 = detail::squared_norm<S>(w);
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
    const Matrix3 U = SO3<S>::hat(upsilon), W = SO3<S>::hat(w);
    const Matrix3 WU = detail::product<S>(W, U), UW = detail::product<S>(U, W),
                  WUW = detail::product<S>(W, UW);
    const Matrix3 WWU = detail::product<S>(W, WU), UWW = detail::product<S>(UW, W);
    const Matrix3 WUWW = detail::product<S>(WUW, W), WWUW = detail::product<S>(W, WUW);
    const Matrix3 J = SO3<S>::left_jacobian_inverse(w);
    Matrix3 Q, minus_J;
    for (int k = 0; k < 9; ++k) {
      const int i = k % 3, j = k / 3;
      Q(i, j) = S(0.5) * U(i, j) + b * (WU(i, j) + UW(i, j) + WUW(i, j)) +
                c * (WWU(i, j) + UWW(i, j) - S(3) * WUW(i, j)) + d * (WUWW(i, j) + WWUW(i, j));
      minus_J(i, j) = -J(i, j);
    }
    return upper_blocks(J, detail::product<S>(detail::product<S>(minus_J, Q), J));
  }
  template <Scalar T>
  [[nodiscard]] SE3<T> cast() const {
    return SE3<T>(R_.template cast<T>(), t_.template cast<T>());
  }

 private:
  /// [A B; 0 A].
  [[nodiscard]] static Matrix6 upper_blocks(const Matrix3& A, const Matrix3& B) {
    Matrix6 m;
    for (int j = 0; j < 3; ++j) {
      for (int i = 0; i < 3; ++i) {
        m(i, j) = m(i + 3, j + 3) = A(i, j);
        m(i, j + 3) = B(i, j);
        m(i + 3, j) = S(0);
      }
    }
    return m;
  }

  SO3<S> R_;
  Vector3 t_;
};

/// Rigid motions in single precision.
using SE3f = SE3<float>;
/// Rigid motions in double precision.
using SE3d = SE3<double>;

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
