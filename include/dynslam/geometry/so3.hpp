// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

#include "dynslam/concepts/scalar.hpp"

// Eigen's expressions cost the compiler seconds in every source that uses a rotation, so what is small is
// spelled out, in the order in which Eigen adds.
namespace dynslam {
namespace detail {

/// A v for a 3x3 matrix and a vector. The sums are those of Eigen with pairs of doubles: two rows in one
/// order, the last in the other.
template <Scalar S>
[[nodiscard]] Eigen::Matrix<S, 3, 1> product(const Eigen::Matrix<S, 3, 3>& A,
                                             const Eigen::Matrix<S, 3, 1>& v) {
  Eigen::Matrix<S, 3, 1> r;
  for (int i = 0; i < 2; ++i) r[i] = A(i, 0) * v[0] + A(i, 1) * v[1] + A(i, 2) * v[2];
  r[2] = A(2, 0) * v[0] + (A(2, 1) * v[1] + A(2, 2) * v[2]);
  return r;
}

/// A B for 3x3 matrices, column by column.
template <Scalar S>
[[nodiscard]] Eigen::Matrix<S, 3, 3> product(const Eigen::Matrix<S, 3, 3>& A,
                                             const Eigen::Matrix<S, 3, 3>& B) {
  Eigen::Matrix<S, 3, 3> C;
  for (int j = 0; j < 3; ++j) {
    const Eigen::Matrix<S, 3, 1> c = product<S>(A, Eigen::Matrix<S, 3, 1>(B(0, j), B(1, j), B(2, j)));
    for (int i = 0; i < 3; ++i) C(i, j) = c[i];
  }
  return C;
}

/// |v|^2.
template <Scalar S>
[[nodiscard]] S squared_norm(const Eigen::Matrix<S, 3, 1>& v) {
  return v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
}

/// Cross products of A's columns 1 and 2, 2 and 0, 0 and 1: the transpose of the inverse times the
/// determinant.
template <Scalar S>
[[nodiscard]] Eigen::Matrix<S, 3, 3> cofactors(const Eigen::Matrix<S, 3, 3>& A) {
  Eigen::Matrix<S, 3, 3> C;
  for (int j = 0; j < 3; ++j) {
    const int j1 = (j + 1) % 3, j2 = (j + 2) % 3;
    for (int i = 0; i < 3; ++i) {
      const int i1 = (i + 1) % 3, i2 = (i + 2) % 3;
      C(i, j) = A(i1, j1) * A(i2, j2) - A(i2, j1) * A(i1, j2);
    }
  }
  return C;
}

}  // namespace detail

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
  explicit SO3(const Quaternion& q) : q_(q) { normalize(); }
  /// Requires a rotation matrix.
  explicit SO3(const Matrix3& R) : q_(R) { normalize(); }

  /// A rotation from the quaternion() of another one, to the last bit: normalising again may change it.
  [[nodiscard]] static SO3 from_unit(const Quaternion& q) {
    SO3 R;
    R.q_ = q;
    return R;
  }

  [[nodiscard]] static Matrix3 hat(const Vector3& w) {
    Matrix3 m;
    m(0, 0) = m(1, 1) = m(2, 2) = S(0);
    m(0, 1) = -w[2], m(1, 0) = w[2];
    m(0, 2) = w[1], m(2, 0) = -w[1];
    m(1, 2) = -w[0], m(2, 1) = w[0];
    return m;
  }
  [[nodiscard]] static Vector3 vee(const Matrix3& m) { return Vector3(m(2, 1), m(0, 2), m(1, 0)); }

  /// Rodrigues; a series below 1e-4 rad keeps it exact and differentiable at zero.
  [[nodiscard]] static SO3 exp(const Vector3& w) {
    using std::cos;
    using std::sin;
    using std::sqrt;
    const S t2 = detail::squared_norm<S>(w);
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
    const Vector3 v(q_.x(), q_.y(), q_.z());
    const S n2 = detail::squared_norm<S>(v);
    const S w = sign * q_.w();
    S factor;  // angle / sin(angle/2)
    if (n2 < S(1e-8)) {
      factor = S(2) / w - S(2) / S(3) * n2 / (w * w * w);
    } else {
      const S n = sqrt(n2);
      factor = S(2) * atan2(n, w) / n;
    }
    factor *= sign;
    return Vector3(factor * v[0], factor * v[1], factor * v[2]);
  }

  [[nodiscard]] SO3 inverse() const { return SO3(q_.conjugate()); }
  [[nodiscard]] SO3 operator*(const SO3& other) const { return SO3(q_ * other.q_); }
  [[nodiscard]] Vector3 operator*(const Vector3& p) const {
    const S x = q_.x(), y = q_.y(), z = q_.z(), w = q_.w();
    const S ux = S(2) * (y * p[2] - z * p[1]), uy = S(2) * (z * p[0] - x * p[2]),
            uz = S(2) * (x * p[1] - y * p[0]);
    return Vector3(p[0] + w * ux + (y * uz - z * uy), p[1] + w * uy + (z * ux - x * uz),
                   p[2] + w * uz + (x * uy - y * ux));
  }
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
    const S t2 = detail::squared_norm<S>(w);
    S a, b;  // (1 - cos t)/t^2, (t - sin t)/t^3
    if (t2 < S(1e-4)) {
      a = S(0.5) - t2 / S(24) + t2 * t2 / S(720);
      b = S(1) / S(6) - t2 / S(120) + t2 * t2 / S(5040);
    } else {
      const S t = sqrt(t2);
      a = (S(1) - cos(t)) / t2;
      b = (t - sin(t)) / (t2 * t);
    }
    return one_plus(a, b, w);
  }

  /// Inverse of left_jacobian; valid for |w| < 2 pi.
  [[nodiscard]] static Matrix3 left_jacobian_inverse(const Vector3& w) {
    using std::cos;
    using std::sin;
    using std::sqrt;
    const S t2 = detail::squared_norm<S>(w);
    S c;  // 1/t^2 - (1 + cos t) / (2 t sin t)
    if (t2 < S(1e-4)) {
      c = S(1) / S(12) + t2 / S(720) + t2 * t2 / S(30240);
    } else {
      // (1 + cos t) / sin t = cot(t/2) stays finite at pi
      const S t = sqrt(t2);
      c = S(1) / t2 - cos(S(0.5) * t) / (S(2) * t * sin(S(0.5) * t));
    }
    return one_plus(S(-0.5), c, w);
  }

 private:
  void normalize() {
    using std::sqrt;
    const S n2 = (q_.x() * q_.x() + q_.z() * q_.z()) + (q_.y() * q_.y() + q_.w() * q_.w());
    if (!(n2 > S(0))) return;
    const S n = sqrt(n2);
    q_ = Quaternion(q_.w() / n, q_.x() / n, q_.y() / n, q_.z() / n);
  }
  /// 1 + a hat(w) + b hat(w)^2.
  [[nodiscard]] static Matrix3 one_plus(const S& a, const S& b, const Vector3& w) {
    const S bx = b * w[0], by = b * w[1], bz = b * w[2];
    Matrix3 m;
    m(0, 0) = S(1) - (by * w[1] + bz * w[2]);
    m(1, 1) = S(1) - (bx * w[0] + bz * w[2]);
    m(2, 2) = S(1) - (bx * w[0] + by * w[1]);
    m(0, 1) = by * w[0] - a * w[2], m(1, 0) = bx * w[1] + a * w[2];
    m(0, 2) = bz * w[0] + a * w[1], m(2, 0) = bx * w[2] - a * w[1];
    m(1, 2) = bz * w[1] - a * w[0], m(2, 1) = by * w[2] + a * w[0];
    return m;
  }

  Quaternion q_;
};

/// Rotations in single precision.
using SO3f = SO3<float>;
/// Rotations in double precision.
using SO3d = SO3<double>;

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
