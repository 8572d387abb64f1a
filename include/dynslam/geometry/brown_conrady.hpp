// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <optional>

#include "dynslam/geometry/detail/first_root.hpp"
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

  /// Inverse by Newton's method: distort() of it is `d` to 64 roundings of the larger of 1 and |d| (4e-3 px
  /// at a focal length of 500 in floats). nullopt where there is none in the field, or none to that accuracy.
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
    const std::array k{k1_, k2_, p1_, p2_, k3_, k4_, k5_, k6_};
    Eigen::Matrix<S, 8, 1> all;
    for (std::size_t i = 0; i < k.size(); ++i) all(static_cast<Eigen::Index>(i)) = k[i];
    return all;
  }

 private:
  /// a + b c. Sums are built of it because each longer one is another expression type for a compiler to work
  /// out where S is Eigen::AutoDiffScalar.
  [[nodiscard]] static S plus(const S& a, const S& b, const S& c) { return a + b * c; }
  /// 1 + a t + b t^2 + c t^3
  [[nodiscard]] static S cubic(const S& t, const S& a, const S& b, const S& c) {
    return plus(S(1), t, plus(a, t, plus(b, t, c)));
  }
  /// Its derivative by t.
  [[nodiscard]] static S slope_of_cubic(const S& t, const S& a, const S& b, const S& c) {
    return plus(a, t, plus(S(2) * b, t * S(3), c));
  }
  [[nodiscard]] S numerator(const S& r2) const { return cubic(r2, k1_, k2_, k3_); }
  [[nodiscard]] S denominator(const S& r2) const { return cubic(r2, k4_, k5_, k6_); }
  /// Distance from the centre to which the radial part leads from the distance r.
  [[nodiscard]] S radially(const S& r) const {
    const S r2 = r * r, factor = numerator(r2) / denominator(r2);
    return r * factor;
  }
  [[nodiscard]] static S squared_length(const S& x, const S& y) { return x * x + y * y; }

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
    const S xx = x * x, yy = y * y, xy = x * y, r2 = xx + yy, two = S(2);
    const S below = denominator(r2), factor = numerator(r2) / below;
    const S turn = slope_of_cubic(r2, k1_, k2_, k3_) - factor * slope_of_cubic(r2, k4_, k5_, k6_);
    const S twice = two * turn, slope = twice / below;  // d factor / d r2, times 2
    const S p1_2 = two * p1_, p2_2 = two * p2_, p1_6 = S(6) * p1_, p2_6 = S(6) * p2_;
    J(0, 0) = plus(plus(plus(factor, slope, xx), p1_2, y), p2_6, x);
    J(1, 1) = plus(plus(plus(factor, slope, yy), p1_6, y), p2_2, x);
    J(1, 0) = J(0, 1) = plus(plus(slope * xy, p1_2, x), p2_2, y);
    return Vector2(plus(plus(x * factor, p1_2, xy), p2_, plus(r2, two, xx)),
                   plus(plus(y * factor, p1_, plus(r2, two, yy)), p2_2, xy));
  }

  /// a d - b c
  [[nodiscard]] static S cross(const S& a, const S& b, const S& c, const S& d) { return a * d - b * c; }
  [[nodiscard]] static S determinant(const Matrix2& J) { return cross(J(0, 0), J(0, 1), J(1, 0), J(1, 1)); }

  /// A determinant of 1e-6 means that a pixel of the recorded image is seen a thousand times enlarged.
  [[nodiscard]] bool in_field(const Vector2& n, const Matrix2& J) const {
    return squared_length(n.x(), n.y()) < S(valid_r2_) && S(1e-6) < determinant(J);
  }

  [[nodiscard]] std::optional<Vector2> newton(const Vector2& d, Vector2 x) const {
    constexpr int kIterations = 20;  // 3 to 6 in an image
    const S tolerance = S(64) * Eigen::NumTraits<S>::epsilon(), size = squared_length(d.x(), d.y());
    const S enough = tolerance * tolerance * (size < S(1) ? S(1) : size);
    Matrix2 J;
    for (int i = 0; i < kIterations; ++i) {
      const Vector2 at = evaluate(x, J);
      const S e_x = at.x() - d.x(), e_y = at.y() - d.y();
      const bool solved = squared_length(e_x, e_y) <= enough;
      if (solved && std::floating_point<S>) return in_field(x, J) ? std::optional<Vector2>(x) : std::nullopt;
      const S det = determinant(J);
      if (!(S(1e-6) < det)) return std::nullopt;  // folded over: no inverse here
      const S step_x = cross(J(1, 1), J(0, 1), e_y, e_x), step_y = cross(J(0, 0), J(1, 0), e_x, e_y);
      x.x() -= step_x / det;
      x.y() -= step_y / det;
      // The derivatives of dual numbers arrive with the step after the value's last.
      if (solved) return in_field(x, J) ? std::optional<Vector2>(x) : std::nullopt;
    }
    return std::nullopt;
  }

  /// The point on the ray of `d` whose radial distortion alone leads to |d|, by bisection of the field;
  /// nullopt where |d| is far beyond the field.
  [[nodiscard]] std::optional<Vector2> on_radius(const Vector2& d) const {
    using std::sqrt;
    const S r_d = sqrt(squared_length(d.x(), d.y()));
    if (!(S(0) < r_d)) return std::nullopt;
    S low = S(0), high = r_d;
    if (std::isfinite(valid_r2_)) {
      // Tangential terms may lead a little beyond the largest radial distortion: begin just inside.
      high = S(0.98) * sqrt(S(valid_r2_));
    } else {  // nothing folds: as far as it takes
      while (radially(high) < r_d && high < S(kWidest)) high *= S(2);
    }
    for (int i = 0; i < 12; ++i) {  // to 1 / 4096 of the field: Newton's method does the rest
      const S middle = S(0.5) * (low + high);
      (radially(middle) < r_d ? low : high) = middle;
    }
    const S scale = high / r_d;
    return Vector2(d.x() * scale, d.y() * scale);
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
      for (int k = 0; k < 3; ++k) {
        const S u = (*J)(0, k), v = (*J)(1, k);
        (*J)(0, k) = lens(0, 0) * u + lens(0, 1) * v;
        (*J)(1, k) = lens(1, 0) * u + lens(1, 1) * v;
      }
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
  [[nodiscard]] Vector2 to_normalised(const Vector2& x) const {
    const Vector3 ray = pinhole_.ray(x);
    return Vector2(ray.x(), ray.y());
  }
  [[nodiscard]] Vector2 to_pixel(const Vector2& n) const {
    return Vector2(pinhole_.fx() * n.x() + pinhole_.cx(), pinhole_.fy() * n.y() + pinhole_.cy());
  }
  Pinhole<S> pinhole_;
  BrownConrady<S> distortion_;
};

static_assert(DifferentiableCamera<PinholeBrownConrady<float>> &&
              DifferentiableCamera<PinholeBrownConrady<double>>);

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
