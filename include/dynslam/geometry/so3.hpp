// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "dynslam/concepts/scalar.hpp"

namespace dynslam {

/// Rotations in 3-D, stored as a unit quaternion. Tangent: rotation vector omega [rad].
template <Scalar S>
class SO3 {
 public:
  using ScalarType = S;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  using Matrix3 = Eigen::Matrix<S, 3, 3>;
  using Quaternion = Eigen::Quaternion<S>;

  SO3() : q_(Quaternion::Identity()) {}
  /// Requires a nonzero quaternion; it is normalised.
  explicit SO3(const Quaternion& q) : q_(q.normalized()) {}
  /// Requires a rotation matrix.
  explicit SO3(const Matrix3& R) : q_(R) { q_.normalize(); }

  /// A rotation from the quaternion() of another one, to the last bit: normalising again may change it.
  [[nodiscard]] static SO3 from_unit(const Quaternion& q) {
    SO3 R;
    R.q_ = q;
    return R;
  }

  [[nodiscard]] static Matrix3 hat(const Vector3& w) {
    Matrix3 m;
    m << S(0), -w.z(), w.y(), w.z(), S(0), -w.x(), -w.y(), w.x(), S(0);
    return m;
  }
  [[nodiscard]] static Vector3 vee(const Matrix3& m) { return Vector3(m(2, 1), m(0, 2), m(1, 0)); }

  /// Rodrigues; a series below 1e-4 rad keeps it exact and differentiable at zero.
  [[nodiscard]] static SO3 exp(const Vector3& w) {
    using std::cos;
    using std::sin;
    using std::sqrt;
    const S t2 = w.squaredNorm();
    S real, imaginary;  // cos(t/2), sin(t/2)/t
    if (t2 < S(1e-8)) {
      real = S(1) - t2 / S(8);
      imaginary = S(0.5) - t2 / S(48);
    } else {
      const S t = sqrt(t2);
      real = cos(S(0.5) * t);
      imaginary = sin(S(0.5) * t) / t;
    }
    return SO3(Quaternion(real, imaginary * w.x(), imaginary * w.y(), imaginary * w.z()));
  }

  /// Rotation vector with norm in [0, pi].
  [[nodiscard]] Vector3 log() const {
    using std::atan2;
    using std::sqrt;
    const S sign = q_.w() < S(0) ? S(-1) : S(1);
    const S n2 = q_.vec().squaredNorm();
    const S w = sign * q_.w();
    S factor;  // angle / sin(angle/2)
    if (n2 < S(1e-8)) {
      factor = S(2) / w - S(2) / S(3) * n2 / (w * w * w);
    } else {
      const S n = sqrt(n2);
      factor = S(2) * atan2(n, w) / n;
    }
    return sign * factor * q_.vec();
  }

  [[nodiscard]] SO3 inverse() const { return SO3(q_.conjugate()); }
  [[nodiscard]] SO3 operator*(const SO3& other) const { return SO3(q_ * other.q_); }
  [[nodiscard]] Vector3 operator*(const Vector3& p) const { return q_ * p; }
  [[nodiscard]] Matrix3 matrix() const { return q_.toRotationMatrix(); }
  [[nodiscard]] const Quaternion& quaternion() const { return q_; }
  /// Adjoint of SO(3) is the rotation matrix itself.
  [[nodiscard]] Matrix3 adjoint() const { return matrix(); }
  template <Scalar T>
  [[nodiscard]] SO3<T> cast() const {
    return SO3<T>(q_.template cast<T>());
  }

  /// J_l(w): exp(w + d) ~ exp(J_l(w) d) exp(w).
  [[nodiscard]] static Matrix3 left_jacobian(const Vector3& w) {
    using std::cos;
    using std::sin;
    using std::sqrt;
    const S t2 = w.squaredNorm();
    S a, b;  // (1 - cos t)/t^2, (t - sin t)/t^3
    if (t2 < S(1e-4)) {
      a = S(0.5) - t2 / S(24) + t2 * t2 / S(720);
      b = S(1) / S(6) - t2 / S(120) + t2 * t2 / S(5040);
    } else {
      const S t = sqrt(t2);
      a = (S(1) - cos(t)) / t2;
      b = (t - sin(t)) / (t2 * t);
    }
    const Matrix3 W = hat(w);
    return Matrix3::Identity() + a * W + b * W * W;
  }

  /// Inverse of left_jacobian; valid for |w| < 2 pi.
  [[nodiscard]] static Matrix3 left_jacobian_inverse(const Vector3& w) {
    using std::cos;
    using std::sin;
    using std::sqrt;
    const S t2 = w.squaredNorm();
    S c;  // 1/t^2 - (1 + cos t) / (2 t sin t)
    if (t2 < S(1e-4)) {
      c = S(1) / S(12) + t2 / S(720) + t2 * t2 / S(30240);
    } else {
      // (1 + cos t) / sin t = cot(t/2) stays finite at pi
      const S t = sqrt(t2);
      c = S(1) / t2 - cos(S(0.5) * t) / (S(2) * t * sin(S(0.5) * t));
    }
    const Matrix3 W = hat(w);
    return Matrix3::Identity() - S(0.5) * W + c * W * W;
  }

 private:
  Quaternion q_;
};

/// Rotations in single precision.
using SO3f = SO3<float>;
/// Rotations in double precision.
using SO3d = SO3<double>;

}  // namespace dynslam
