// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/concepts/scalar.hpp"
#include "dynslam/geometry/detail/first_root.hpp"

namespace dynslam {

/// Fisheye camera after Kannala and Brandt (2006) with OpenCV's four coefficients: a ray at the angle theta
/// from the optical axis is imaged at the distance f theta_d from the centre,
///
///     theta_d = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8).
///
/// Promised for angles below 90 degrees and below max_angle(), where the curve turns back or the caller lets
/// the field end: points with z <= 1e-6 m have no pixel, and pixels farther out no point, because a depth
/// along the optical axis says little about them. What a lens sees at 90 degrees and beyond is left unused.
template <Scalar S>
class KannalaBrandt {
 public:
  using ScalarType = S;
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  using Vector4 = Eigen::Matrix<S, 4, 1>;
  using Jacobian = Eigen::Matrix<S, 2, 3>;
  static constexpr double kRightAngle = 0.5 * std::numbers::pi;

  KannalaBrandt() : KannalaBrandt(S(1), S(1), S(0), S(0), Vector4(S(0), S(0), S(0), S(0))) {}
  /// @param fx, fy, cx, cy  pixels
  /// @param k               k1 ... k4, radians
  /// @param widest          angle at which the field ends at the latest, at most pi / 2 [rad]
  KannalaBrandt(S fx, S fy, S cx, S cy, const Vector4& k, double widest = kRightAngle)
      : fx_(fx), fy_(fy), cx_(cx), cy_(cy), k_(k) {
    const double t = detail::first_root(std::array{1.0, 3.0 * to_double(k(0)), 5.0 * to_double(k(1)),
                                                   7.0 * to_double(k(2)), 9.0 * to_double(k(3))},
                                        kRightAngle * kRightAngle);
    max_angle_ = std::min({kRightAngle, widest, std::sqrt(t)});
  }

  [[nodiscard]] const S& fx() const { return fx_; }
  [[nodiscard]] const S& fy() const { return fy_; }
  [[nodiscard]] const S& cx() const { return cx_; }
  [[nodiscard]] const S& cy() const { return cy_; }
  [[nodiscard]] const Vector4& coefficients() const { return k_; }
  /// Angle from the optical axis up to which the camera is one-to-one [rad], at most pi / 2.
  [[nodiscard]] double max_angle() const { return max_angle_; }

  /// Pixel of a camera-frame point; nullopt beyond max_angle() and for z <= 1e-6 m.
  [[nodiscard]] std::optional<Vector2> project(const Vector3& p) const { return project(p, nullptr); }

  /// The same with the derivative d x / d p (2 x 3) where `J` is given.
  [[nodiscard]] std::optional<Vector2> project(const Vector3& p, Jacobian* J) const {
    if (!(S(1e-6) < p.z())) return std::nullopt;
    const S inverse = S(1) / p.z();
    const S x = p.x() * inverse, y = p.y() * inverse, q = x * x + y * y;
    const Curve curve = at(q);
    if (!(curve.theta2 < S(max_angle_ * max_angle_))) return std::nullopt;
    const S scale = curve.scale;  // x_d = scale x
    if (J != nullptr) {
      const S slope = S(2) * curve.slope, s_x = slope * x, s_y = slope * y, xy = s_x * y;
      const S radial = plus(scale, slope, q);  // along the ray, x_d changes by this
      const S u = fx_ * inverse, v = fy_ * inverse, ux = u * x, vy = v * y;
      (*J)(0, 0) = u * plus(scale, s_x, x);
      (*J)(0, 1) = u * xy;
      (*J)(0, 2) = -(ux * radial);
      (*J)(1, 0) = v * xy;
      (*J)(1, 1) = v * plus(scale, s_y, y);
      (*J)(1, 2) = -(vy * radial);
    }
    return Vector2(plus(cx_, fx_ * scale, x), plus(cy_, fy_ * scale, y));
  }

  /// Camera-frame point of a pixel at the depth z along the optical axis [m]; nullopt beyond max_angle().
  [[nodiscard]] std::optional<Vector3> unproject(const Vector2& x, const S& z) const {
    using std::cos;
    using std::sin;
    using std::sqrt;
    const S from_x = x.x() - cx_, from_y = x.y() - cy_;
    const S u = from_x / fx_, v = from_y / fy_, q = u * u + v * v;
    if (to_double(q) < 1e-12) return Vector3(u * z, v * z, z);  // theta^3 is below rounding
    const S theta_d = sqrt(q);
    const auto theta = angle(theta_d);
    if (!theta) return std::nullopt;
    const S sine = sin(*theta), cosine = cos(*theta), below = cosine * theta_d;
    const S per_depth = sine / below, scale = per_depth * z;
    return Vector3(u * scale, v * scale, z);
  }

  template <Scalar T>
  [[nodiscard]] KannalaBrandt<T> cast() const {
    return KannalaBrandt<T>(T(fx_), T(fy_), T(cx_), T(cy_), k_.template cast<T>(), max_angle_);
  }

 private:
  /// a + b c. Sums are built of it because each longer one is another expression type for a compiler to work
  /// out where S is Eigen::AutoDiffScalar.
  [[nodiscard]] static S plus(const S& a, const S& b, const S& c) { return a + b * c; }

  /// theta^2, theta_d / r and the latter's derivative by r^2, at q = r^2 = tan(theta)^2.
  struct Curve {
    S theta2, scale, slope;
  };
  [[nodiscard]] Curve at(const S& q) const {
    using std::atan2;
    using std::sqrt;
    S a, b;  // theta / r and its derivative by q
    if (q < S(1e-4)) {
      const S third = S(1) / S(3), minus = -q, q3 = q * S(3), q3_7 = q3 / S(7), q_7 = q / S(7);
      const S a5 = S(1) / S(5), b5 = S(2) / S(5);
      a = plus(S(1), minus, plus(third, minus, a5 - q_7));
      b = plus(-third, q, b5 - q3_7);
    } else {
      const S r = sqrt(q), theta = atan2(r, S(1)), above = S(1) + q, cosine2 = S(1) / above;
      a = theta / r;
      const S turn = cosine2 - a, q2 = S(2) * q;
      b = turn / q2;
    }
    const S qa = q * a, t = qa * a, factor = factor_at(t);
    const S steep = a * plus(k_(0), t, weighted(t, S(2), S(3), S(4))), twist = plus(a, S(2) * q, b);
    return {t, a * factor, plus(b * factor, steep * a, twist)};
  }
  /// Of theta_d / theta, at t = theta^2.
  [[nodiscard]] S factor_at(const S& t) const {
    return plus(S(1), t, plus(k_(0), t, plus(k_(1), t, plus(k_(2), t, k_(3)))));
  }
  /// a k2 + b k3 t + c k4 t^2
  [[nodiscard]] S weighted(const S& t, const S& a, const S& b, const S& c) const {
    return plus(a * k_(1), t, plus(b * k_(2), t * c, k_(3)));
  }

  /// Inverse of theta_d by Newton's method, kept between the axis and max_angle() by bisection: a step that
  /// is not half of the one before it is no Newton step near a solution, but goes to and fro before an
  /// inflection. nullopt where it has not ended, which bisection excludes.
  [[nodiscard]] std::optional<S> angle(const S& theta_d) const {
    using std::abs;
    constexpr int kIterations = 120;  // Newton takes 3 to 6; bisection at every other one needs 106
    const S tolerance = S(4) * Eigen::NumTraits<S>::epsilon();
    S low = S(0), high = S(max_angle_);
    if (!(theta_d < high * factor(high))) return std::nullopt;
    S theta = theta_d < high ? theta_d : S(0.5) * high;
    S last = high;  // step
    for (int i = 0; i < kIterations; ++i) {
      const S error = theta * factor(theta) - theta_d;
      (error < S(0) ? low : high) = theta;
      const S t = theta * theta;
      const S slope = plus(S(1), t, plus(S(3) * k_(0), t, weighted(t, S(5), S(7), S(9))));
      S next = theta - error / slope;
      const bool done = abs(next - theta) <= tolerance * (S(1) + theta);
      if (!done && !(low <= next && next <= high && abs(next - theta) <= S(0.5) * last))
        next = S(0.5) * (low + high);
      last = abs(next - theta);
      theta = next;
      if (done || last <= tolerance * (S(1) + theta)) return theta;
    }
    return std::nullopt;
  }
  [[nodiscard]] S factor(const S& theta) const { return factor_at(theta * theta); }

  S fx_, fy_, cx_, cy_;
  Vector4 k_;
  double max_angle_;
};

static_assert(DifferentiableCamera<KannalaBrandt<float>> && DifferentiableCamera<KannalaBrandt<double>>);

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
