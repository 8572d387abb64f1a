// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <optional>

#include "dynslam/geometry/first_root.hpp"
#include "dynslam/geometry/pinhole.hpp"

namespace dynslam {

/// Brown-Conrady lens distortion of normalised coordinates, in OpenCV's order and sign:
/// x_d = x f(r^2) + [2 p1 x y + p2 (r^2 + 2 x^2), p1 (r^2 + 2 y^2) + 2 p2 x y] with
/// f(r^2) = (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6);
/// five coefficients have k4 = k5 = k6 = 0, eight are OpenCV's rational model (ROS: rational_polynomial).
///
/// f describes a lens only up to the radius where r f(r^2) turns back (d r_d / d r = 0) or its denominator
/// ends at 0; beyond, it would put what lies outside the field into the image. The field is what is within
/// valid_radius() and, which differs with p1 and p2 only, not folded over (a Jacobian with a positive
/// determinant).
template <Scalar S>
class BrownConrady {
 public:
  using ScalarType = S;
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  using Matrix2 = Eigen::Matrix<S, 2, 2>;

  BrownConrady() = default;  ///< no distortion
  BrownConrady(S k1, S k2, S p1, S p2, S k3, S k4 = S(0), S k5 = S(0), S k6 = S(0))
      : k1_(k1), k2_(k2), p1_(p1), p2_(p2), k3_(k3), k4_(k4), k5_(k5), k6_(k6), valid_r2_(field()) {}

  /// Whether all coefficients are plain zeros. Dual numbers never are: their derivatives count.
  [[nodiscard]] bool is_identity() const {
    if constexpr (std::floating_point<S>) {
      return k1_ == S(0) && k2_ == S(0) && p1_ == S(0) && p2_ == S(0) && k3_ == S(0) && !is_rational();
    } else {
      return false;
    }
  }

  /// Whether there is a denominator: one of k4, k5 and k6 is not 0.
  [[nodiscard]] bool is_rational() const {
    return to_double(k4_) != 0 || to_double(k5_) != 0 || to_double(k6_) != 0;
  }

  /// Radius of the field in normalised coordinates, the tangent of its angle; infinite where nothing folds.
  [[nodiscard]] double valid_radius() const { return std::sqrt(valid_r2_); }

  /// Distorted coordinates; nullopt outside the field.
  [[nodiscard]] std::optional<Vector2> distort(const Vector2& x) const { return distort(x, nullptr); }

  /// With the derivative d x_d / d x where `J` is given.
  [[nodiscard]] std::optional<Vector2> distort(const Vector2& n, Matrix2* J) const {
    Matrix2 slope;
    const Vector2 d = evaluate(n, slope);
    if (!in_field(n, slope)) return std::nullopt;
    if (J != nullptr) *J = slope;
    return d;
  }

  /// Inverse by Newton's method; nullopt where there is none in the field.
  [[nodiscard]] std::optional<Vector2> undistort(const Vector2& d) const {
    if (is_identity()) return d;
    if (const auto x = newton(d, d)) return x;
    // A steep lens throws the first step out of the field: begin again near the solution, which is at the
    // place along the radius where the radial part alone has it.
    const auto x = on_radius(d);
    return x ? newton(d, *x) : std::nullopt;
  }

  template <Scalar T>
  [[nodiscard]] BrownConrady<T> cast() const {
    return BrownConrady<T>(T(k1_), T(k2_), T(p1_), T(p2_), T(k3_), T(k4_), T(k5_), T(k6_));
  }

  /// In OpenCV's order: k1 k2 p1 p2 k3 k4 k5 k6.
  [[nodiscard]] Eigen::Matrix<S, 8, 1> coefficients() const {
    return (Eigen::Matrix<S, 8, 1>() << k1_, k2_, p1_, p2_, k3_, k4_, k5_, k6_).finished();
  }

 private:
  [[nodiscard]] S numerator(const S& r2) const { return S(1) + r2 * (k1_ + r2 * (k2_ + r2 * k3_)); }
  [[nodiscard]] S denominator(const S& r2) const { return S(1) + r2 * (k4_ + r2 * (k5_ + r2 * k6_)); }
  [[nodiscard]] S radial(const S& r2) const { return numerator(r2) / denominator(r2); }

  /// Smallest r^2 at which r f(r^2) turns back or the denominator is 0. With f = N / D and t = r^2 the slope
  /// d r_d / d r is ((N + 2 t N') D - N 2 t D') / D^2.
  [[nodiscard]] double field() const {
    const std::array n{1.0, to_double(k1_), to_double(k2_), to_double(k3_)};
    const std::array d{1.0, to_double(k4_), to_double(k5_), to_double(k6_)};
    std::array<double, 7> slope{};
    for (std::size_t i = 0; i < n.size(); ++i) {
      for (std::size_t j = 0; j < d.size(); ++j)
        slope[i + j] += (1.0 + 2.0 * static_cast<double>(i) - 2.0 * static_cast<double>(j)) * n[i] * d[j];
    }
    return std::min(detail::first_root(slope, kWidest * kWidest), detail::first_root(d, kWidest * kWidest));
  }

  [[nodiscard]] Vector2 evaluate(const Vector2& n, Matrix2& J) const {
    const S x = n.x(), y = n.y();
    const S xx = x * x, yy = y * y, xy = x * y, r2 = xx + yy;
    const S below = denominator(r2), factor = numerator(r2) / below;
    const S rise = k1_ + r2 * (S(2) * k2_ + r2 * S(3) * k3_),
            fall = k4_ + r2 * (S(2) * k5_ + r2 * S(3) * k6_);
    const S slope = S(2) * (rise - factor * fall) / below;  // d factor / d r2, times 2
    const S cross = slope * xy + S(2) * p1_ * x + S(2) * p2_ * y;
    J << factor + slope * xx + S(2) * p1_ * y + S(6) * p2_ * x, cross, cross,
        factor + slope * yy + S(6) * p1_ * y + S(2) * p2_ * x;
    return Vector2(x * factor + S(2) * p1_ * xy + p2_ * (r2 + S(2) * xx),
                   y * factor + p1_ * (r2 + S(2) * yy) + S(2) * p2_ * xy);
  }

  [[nodiscard]] static S determinant(const Matrix2& J) { return J(0, 0) * J(1, 1) - J(0, 1) * J(1, 0); }

  /// A determinant of 1e-6 means that a pixel of the recorded image is seen a thousand times enlarged.
  [[nodiscard]] bool in_field(const Vector2& n, const Matrix2& J) const {
    return n.squaredNorm() < S(valid_r2_) && S(1e-6) < determinant(J);
  }

  [[nodiscard]] std::optional<Vector2> newton(const Vector2& d, Vector2 x) const {
    const S tolerance = S(64) * Eigen::NumTraits<S>::epsilon();
    Matrix2 J;
    for (int i = 0; i < 20; ++i) {
      const Vector2 error = evaluate(x, J) - d;
      const bool solved = error.squaredNorm() <= tolerance * tolerance;
      if (solved && std::floating_point<S>) return in_field(x, J) ? std::optional<Vector2>(x) : std::nullopt;
      const S det = determinant(J);
      if (!(S(1e-6) < det)) return std::nullopt;  // folded over: no inverse here
      x -=
          Vector2(J(1, 1) * error.x() - J(0, 1) * error.y(), J(0, 0) * error.y() - J(1, 0) * error.x()) / det;
      // The derivatives of dual numbers arrive with the step after the value's last.
      if (solved) return in_field(x, J) ? std::optional<Vector2>(x) : std::nullopt;
    }
    const Vector2 again = evaluate(x, J);
    return again.isApprox(d, S(100) * tolerance) && in_field(x, J) ? std::optional<Vector2>(x) : std::nullopt;
  }

  /// The point on the ray of `d` whose radial distortion alone leads to |d|, by bisection of the field;
  /// nullopt where |d| is far beyond the field.
  [[nodiscard]] std::optional<Vector2> on_radius(const Vector2& d) const {
    using std::sqrt;
    const S r_d = sqrt(d.squaredNorm());
    if (!(S(0) < r_d)) return std::nullopt;
    S low = S(0), high = r_d;
    if (std::isfinite(valid_r2_)) {
      // Tangential terms may lead a little beyond the largest radial distortion: begin just inside.
      high = S(0.98) * sqrt(S(valid_r2_));
    } else {  // nothing folds: as far as it takes
      while (high * radial(high * high) < r_d && high < S(kWidest)) high *= S(2);
    }
    for (int i = 0; i < 12; ++i) {  // to 1 / 4096 of the field: Newton's method does the rest
      const S middle = S(0.5) * (low + high);
      (middle * radial(middle * middle) < r_d ? low : high) = middle;
    }
    return Vector2(d * (high / r_d));
  }

  static constexpr double kWidest = 100;  // tangent of 89.4 degrees: no lens is calibrated so far out
  S k1_ = S(0), k2_ = S(0), p1_ = S(0), p2_ = S(0), k3_ = S(0), k4_ = S(0), k5_ = S(0), k6_ = S(0);
  double valid_r2_ = std::numeric_limits<double>::infinity();
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

  /// Recorded pixel of a camera-frame point; nullopt behind the camera and outside the lens' field.
  [[nodiscard]] std::optional<Vector2> project(const Vector3& p) const { return project(p, nullptr); }
  /// The same with the derivative d x / d p (2 x 3) where `J` is given.
  [[nodiscard]] std::optional<Vector2> project(const Vector3& p, Jacobian* J) const {
    const auto ideal = pinhole_.project(p, J);
    if (!ideal || distortion_.is_identity()) return ideal;
    Matrix2 lens;
    const auto n = distortion_.distort(to_normalised(*ideal), J != nullptr ? &lens : nullptr);
    if (!n) return std::nullopt;
    if (J != nullptr) {  // in pixels: diag(f) lens diag(f)^-1
      const S aspect = pinhole_.fx() / pinhole_.fy();
      lens(0, 1) *= aspect;
      lens(1, 0) /= aspect;
      *J = lens * *J;
    }
    return to_pixel(*n);
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
    const auto n = distortion_.distort(to_normalised(ideal));
    if (!n) return std::nullopt;
    return to_pixel(*n);
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
