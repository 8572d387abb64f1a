// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>

#include "dynslam/concepts/camera.hpp"

namespace dynslam::test {

/// An ideal fisheye of 190 degrees: the image radius is the angle from the optical axis times the focal
/// length. Rays at 90 degrees and beyond are those to points beside and behind it; their `z` in unproject()
/// is the distance from the plane of 90 degrees, or from the camera where that is 0.
template <Scalar T>
class WideFisheye {
 public:
  using ScalarType = T;
  using Vector2 = Eigen::Matrix<T, 2, 1>;
  using Vector3 = Eigen::Matrix<T, 3, 1>;
  static constexpr double kWidest = 95.0 / 180.0 * 3.14159265358979323846;

  WideFisheye(T focal, T cx, T cy) : focal_(focal), centre_(cx, cy) {}

  [[nodiscard]] std::optional<Vector2> project(const Vector3& p) const { return project(p, nullptr); }
  [[nodiscard]] std::optional<Vector2> project(const Vector3& p, Eigen::Matrix<T, 2, 3>* J) const {
    using std::atan2, std::sqrt;
    const T r2 = p.x() * p.x() + p.y() * p.y(), d2 = r2 + p.z() * p.z(), r = sqrt(r2);
    const T angle = atan2(r, p.z());
    if (!(T(1e-12) < d2) || !(angle < T(kWidest))) return std::nullopt;
    const bool axis = r < T(1e-6) * p.z();
    const T scale = axis ? T(T(1) / p.z()) : T(angle / r);
    if (J != nullptr) {
      const T slope = axis ? T(0) : T((p.z() / d2 - scale) / r2);
      (*J)(0, 0) = focal_ * (scale + slope * p.x() * p.x());
      (*J)(1, 1) = focal_ * (scale + slope * p.y() * p.y());
      (*J)(0, 1) = (*J)(1, 0) = focal_ * slope * p.x() * p.y();
      (*J)(0, 2) = -focal_ * p.x() / d2;
      (*J)(1, 2) = -focal_ * p.y() / d2;
    }
    return Vector2(focal_ * scale * p.x() + centre_.x(), focal_ * scale * p.y() + centre_.y());
  }

  [[nodiscard]] std::optional<Vector3> unproject(const Vector2& x, const T& z) const {
    using std::abs, std::cos, std::sin, std::sqrt;
    const T u = (x.x() - centre_.x()) / focal_, v = (x.y() - centre_.y()) / focal_,
            angle = sqrt(u * u + v * v);
    if (!(angle < T(kWidest))) return std::nullopt;
    const T across = angle < T(1e-6) ? T(1) : T(sin(angle) / angle), along = cos(angle);
    const T size = abs(along) < T(1e-6) ? z : T(z / abs(along));
    return Vector3(across * u * size, across * v * size, along * size);
  }

 private:
  T focal_;
  Vector2 centre_;
};

static_assert(DifferentiableCamera<WideFisheye<float>> && DifferentiableCamera<WideFisheye<double>>);

}  // namespace dynslam::test
