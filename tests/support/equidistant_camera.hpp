// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>

#include "dynslam/concepts/camera.hpp"

namespace dynslam::test {

/// A camera that the library does not know: an ideal fisheye, whose image radius is the angle from the
/// optical axis times the focal length. It sees what is in front of it, below 90 degrees.
template <Scalar T>
class EquidistantCamera {
 public:
  using ScalarType = T;
  using Vector2 = Eigen::Matrix<T, 2, 1>;
  using Vector3 = Eigen::Matrix<T, 3, 1>;

  EquidistantCamera(T focal, T cx, T cy) : focal_(focal), centre_(cx, cy) {}

  [[nodiscard]] std::optional<Vector2> project(const Vector3& p) const { return project(p, nullptr); }
  [[nodiscard]] std::optional<Vector2> project(const Vector3& p, Eigen::Matrix<T, 2, 3>* J) const {
    using std::atan2, std::sqrt;
    if (!(p.z() > T(1e-6))) return std::nullopt;
    const T r2 = p.x() * p.x() + p.y() * p.y(), d2 = r2 + p.z() * p.z();
    const T r = sqrt(r2);
    const bool axis = r < T(1e-6) * p.z();
    const T scale = axis ? T(T(1) / p.z()) : T(atan2(r, p.z()) / r);
    if (J != nullptr) {
      // d scale / d (x, y) = slope (x, y), d scale / d z = -1 / d2
      const T slope = axis ? T(0) : T((p.z() / d2 - scale) / r2);
      const T slope_x = slope * p.x(), slope_y = slope * p.y();
      const T across_x = scale + slope_x * p.x(), across_y = scale + slope_y * p.y(), mixed = slope_x * p.y();
      const T along_x = p.x() / d2, along_y = p.y() / d2;
      (*J)(0, 0) = across_x * focal_;
      (*J)(1, 1) = across_y * focal_;
      (*J)(1, 0) = (*J)(0, 1) = mixed * focal_;
      (*J)(0, 2) = -(along_x * focal_);
      (*J)(1, 2) = -(along_y * focal_);
    }
    const T size = focal_ * scale;
    return Vector2(size * p.x() + centre_.x(), size * p.y() + centre_.y());
  }

  [[nodiscard]] std::optional<Vector3> unproject(const Vector2& x, const T& z) const {
    using std::sqrt, std::tan;
    const T from_x = x.x() - centre_.x(), from_y = x.y() - centre_.y();
    const T n_x = from_x / focal_, n_y = from_y / focal_;
    const T angle = sqrt(n_x * n_x + n_y * n_y);
    if (!(angle < T(1.55))) return std::nullopt;
    const T scale = angle < T(1e-6) ? T(1) : T(tan(angle) / angle);
    const T s_x = scale * n_x, s_y = scale * n_y;
    return Vector3(s_x * z, s_y * z, z);
  }

 private:
  T focal_;
  Vector2 centre_;
};

static_assert(DifferentiableCamera<EquidistantCamera<float>> &&
              DifferentiableCamera<EquidistantCamera<double>>);

}  // namespace dynslam::test
