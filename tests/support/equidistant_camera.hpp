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
      *J << scale + slope * p.x() * p.x(), slope * p.x() * p.y(), -p.x() / d2, slope * p.x() * p.y(),
          scale + slope * p.y() * p.y(), -p.y() / d2;
      *J *= focal_;
    }
    return Vector2(focal_ * scale * p.template head<2>() + centre_);
  }

  [[nodiscard]] std::optional<Vector3> unproject(const Vector2& x, const T& z) const {
    using std::tan;
    const Vector2 n = (x - centre_) / focal_;
    const T angle = n.norm();
    if (!(angle < T(1.55))) return std::nullopt;
    const T scale = angle < T(1e-6) ? T(1) : T(tan(angle) / angle);
    return Vector3(scale * n.x() * z, scale * n.y() * z, z);
  }

 private:
  T focal_;
  Vector2 centre_;
};

static_assert(DifferentiableCamera<EquidistantCamera<float>> &&
              DifferentiableCamera<EquidistantCamera<double>>);

}  // namespace dynslam::test
