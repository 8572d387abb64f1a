// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>

#include "dynslam/geometry/pinhole.hpp"

namespace dynslam {

/// Brown-Conrady lens distortion of normalised coordinates, in OpenCV's order and sign:
/// x_d = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + [2 p1 x y + p2 (r^2 + 2 x^2), p1 (r^2 + 2 y^2) + 2 p2 x y].
template <Scalar S>
class BrownConrady {
 public:
  using ScalarType = S;
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  using Matrix2 = Eigen::Matrix<S, 2, 2>;

  BrownConrady() = default;  ///< no distortion
  BrownConrady(S k1, S k2, S p1, S p2, S k3) : k1_(k1), k2_(k2), p1_(p1), p2_(p2), k3_(k3) {}

  [[nodiscard]] bool is_identity() const {
    return k1_ == S(0) && k2_ == S(0) && p1_ == S(0) && p2_ == S(0) && k3_ == S(0);
  }

  [[nodiscard]] Vector2 distort(const Vector2& x) const { return distort(x, nullptr); }

  /// With the derivative d x_d / d x where `J` is given.
  [[nodiscard]] Vector2 distort(const Vector2& n, Matrix2* J) const {
    const S x = n.x(), y = n.y();
    const S xx = x * x, yy = y * y, xy = x * y, r2 = xx + yy;
    const S radial = S(1) + r2 * (k1_ + r2 * (k2_ + r2 * k3_));
    if (J != nullptr) {
      const S slope = S(2) * (k1_ + r2 * (S(2) * k2_ + r2 * S(3) * k3_));  // d radial / d r2, times 2
      const S cross = slope * xy + S(2) * p1_ * x + S(2) * p2_ * y;
      *J << radial + slope * xx + S(2) * p1_ * y + S(6) * p2_ * x, cross, cross,
          radial + slope * yy + S(6) * p1_ * y + S(2) * p2_ * x;
    }
    return Vector2(x * radial + S(2) * p1_ * xy + p2_ * (r2 + S(2) * xx),
                   y * radial + p1_ * (r2 + S(2) * yy) + S(2) * p2_ * xy);
  }

  /// Inverse by Newton's method; nullopt where it does not converge (outside the lens' valid field).
  [[nodiscard]] std::optional<Vector2> undistort(const Vector2& d) const {
    if (is_identity()) return d;
    const S tolerance = S(64) * Eigen::NumTraits<S>::epsilon();
    Vector2 x = d;
    for (int i = 0; i < 20; ++i) {
      Matrix2 J;
      const Vector2 error = distort(x, &J) - d;
      if (error.squaredNorm() <= tolerance * tolerance) return x;
      const S determinant = J(0, 0) * J(1, 1) - J(0, 1) * J(1, 0);
      if (!(S(1e-6) < determinant)) return std::nullopt;  // folded over: no inverse here
      x -= Vector2(J(1, 1) * error.x() - J(0, 1) * error.y(), J(0, 0) * error.y() - J(1, 0) * error.x()) /
           determinant;
    }
    return distort(x).isApprox(d, S(100) * tolerance) ? std::optional<Vector2>(x) : std::nullopt;
  }

  template <Scalar T>
  [[nodiscard]] BrownConrady<T> cast() const {
    return BrownConrady<T>(T(k1_), T(k2_), T(p1_), T(p2_), T(k3_));
  }

  [[nodiscard]] Eigen::Matrix<S, 5, 1> coefficients() const {
    return (Eigen::Matrix<S, 5, 1>() << k1_, k2_, p1_, p2_, k3_).finished();
  }

 private:
  S k1_ = S(0), k2_ = S(0), p1_ = S(0), p2_ = S(0), k3_ = S(0);
};

/// A pinhole camera behind a lens of Brown and Conrady; its pixels are those of the image as recorded.
template <Scalar S>
class PinholeBrownConrady {
 public:
  using ScalarType = S;
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  using Matrix2 = Eigen::Matrix<S, 2, 2>;
  using Jacobian = Eigen::Matrix<S, 2, 3>;

  PinholeBrownConrady() = default;
  explicit PinholeBrownConrady(const Pinhole<S>& pinhole, const BrownConrady<S>& distortion = {})
      : pinhole_(pinhole), distortion_(distortion) {}

  [[nodiscard]] const Pinhole<S>& pinhole() const { return pinhole_; }
  [[nodiscard]] const BrownConrady<S>& distortion() const { return distortion_; }

  /// Recorded pixel of a camera-frame point; nullopt behind the camera.
  [[nodiscard]] std::optional<Vector2> project(const Vector3& p) const { return project(p, nullptr); }
  /// The same with the derivative d x / d p (2 x 3) where `J` is given.
  [[nodiscard]] std::optional<Vector2> project(const Vector3& p, Jacobian* J) const {
    const auto ideal = pinhole_.project(p, J);
    if (!ideal || distortion_.is_identity()) return ideal;
    Matrix2 lens;
    const Vector2 n = distortion_.distort(to_normalised(*ideal), J != nullptr ? &lens : nullptr);
    if (J != nullptr) {  // in pixels: diag(f) lens diag(f)^-1
      const S aspect = pinhole_.fx() / pinhole_.fy();
      lens(0, 1) *= aspect;
      lens(1, 0) /= aspect;
      *J = lens * *J;
    }
    return to_pixel(n);
  }
  /// Camera-frame point of a recorded pixel at depth z [m]; nullopt outside the lens' valid field.
  [[nodiscard]] std::optional<Vector3> unproject(const Vector2& x, const S& z) const {
    const auto ideal = undistort_pixel(x);
    if (!ideal) return std::nullopt;
    return pinhole_.unproject(*ideal, z);
  }

  /// Ideal pinhole pixel to recorded pixel; nullopt outside the lens' valid field.
  [[nodiscard]] std::optional<Vector2> distort_pixel(const Vector2& ideal) const {
    if (distortion_.is_identity()) return ideal;
    return to_pixel(distortion_.distort(to_normalised(ideal)));
  }
  /// Recorded pixel to ideal pinhole pixel; nullopt outside the lens' valid field.
  [[nodiscard]] std::optional<Vector2> undistort_pixel(const Vector2& x) const {
    if (distortion_.is_identity()) return x;
    const auto n = distortion_.undistort(to_normalised(x));
    if (!n) return std::nullopt;
    return to_pixel(*n);
  }
  template <Scalar T>
  [[nodiscard]] PinholeBrownConrady<T> cast() const {
    return PinholeBrownConrady<T>(pinhole_.template cast<T>(), distortion_.template cast<T>());
  }

 private:
  [[nodiscard]] Vector2 to_normalised(const Vector2& x) const { return pinhole_.ray(x).template head<2>(); }
  [[nodiscard]] Vector2 to_pixel(const Vector2& n) const {
    return Vector2(pinhole_.fx() * n.x() + pinhole_.cx(), pinhole_.fy() * n.y() + pinhole_.cy());
  }
  Pinhole<S> pinhole_;
  BrownConrady<S> distortion_;
};

static_assert(DifferentiableCamera<PinholeBrownConrady<float>> &&
              DifferentiableCamera<PinholeBrownConrady<double>>);

}  // namespace dynslam
