// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <optional>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/concepts/scalar.hpp"

namespace dynslam {

/// Ideal pinhole camera, x = K p / p_z (Eqs 1 and 2). Focal lengths and centre in pixels.
template <Scalar S>
class Pinhole {
 public:
  using ScalarType = S;
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  using Matrix3 = Eigen::Matrix<S, 3, 3>;
  using Jacobian = Eigen::Matrix<S, 2, 3>;

  Pinhole() = default;
  Pinhole(S fx, S fy, S cx, S cy) : fx_(fx), fy_(fy), cx_(cx), cy_(cy) {}

  [[nodiscard]] const S& fx() const { return fx_; }
  [[nodiscard]] const S& fy() const { return fy_; }
  [[nodiscard]] const S& cx() const { return cx_; }
  [[nodiscard]] const S& cy() const { return cy_; }

  /// Pixel of a camera-frame point, nullopt when it is not in front of the camera (z <= 1e-6 m).
  [[nodiscard]] std::optional<Vector2> project(const Vector3& p) const { return project(p, nullptr); }

  /// The same with the derivative d x / d p (2 x 3) where `J` is given.
  [[nodiscard]] std::optional<Vector2> project(const Vector3& p, Jacobian* J) const {
    if (!(S(1e-6) < p.z())) return std::nullopt;
    const S inverse = S(1) / p.z();
    const S x = p.x() * inverse, y = p.y() * inverse;
    const S u = fx_ * x, v = fy_ * y;
    if (J != nullptr) {
      (*J)(0, 0) = fx_ * inverse;
      (*J)(1, 0) = (*J)(0, 1) = S(0);
      (*J)(1, 1) = fy_ * inverse;
      (*J)(0, 2) = -(u * inverse);
      (*J)(1, 2) = -(v * inverse);
    }
    return Vector2(u + cx_, v + cy_);
  }

  /// Camera-frame point of a pixel at depth `z` along the optical axis [m]; never empty. `ray(x) * z` is the
  /// same without the `optional`.
  [[nodiscard]] std::optional<Vector3> unproject(const Vector2& x, const S& z) const {
    const Vector3 r = ray(x);
    return Vector3(r.x() * z, r.y() * z, z);
  }
  /// Viewing ray with z = 1.
  [[nodiscard]] Vector3 ray(const Vector2& x) const {
    return Vector3((x.x() - cx_) / fx_, (x.y() - cy_) / fy_, S(1));
  }
  [[nodiscard]] Matrix3 K() const {
    Matrix3 k;
    k(0, 0) = fx_;
    k(1, 1) = fy_;
    k(0, 2) = cx_;
    k(1, 2) = cy_;
    k(2, 2) = S(1);
    k(1, 0) = k(2, 0) = k(0, 1) = k(2, 1) = S(0);
    return k;
  }
  [[nodiscard]] bool operator==(const Pinhole& other) const {
    return fx_ == other.fx_ && fy_ == other.fy_ && cx_ == other.cx_ && cy_ == other.cy_;
  }
  template <Scalar T>
  [[nodiscard]] Pinhole<T> cast() const {
    return Pinhole<T>(T(fx_), T(fy_), T(cx_), T(cy_));
  }

 private:
  S fx_ = S(1), fy_ = S(1), cx_ = S(0), cy_ = S(0);
};

static_assert(DifferentiableCamera<Pinhole<float>> && DifferentiableCamera<Pinhole<double>>);

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
