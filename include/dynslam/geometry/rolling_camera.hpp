// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <optional>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/geometry/ideal_pinhole.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/geometry/rolling_shutter.hpp"

namespace dynslam {

/// A camera whose rows are read one after the other, as a camera: points are in its frame when it read the
/// middle row, pixels are those recorded. What works with any camera works with the image of a rolling
/// shutter by this.
template <DifferentiableCamera C>
class RollingCamera {
 public:
  using ScalarType = typename C::ScalarType;
  using S = ScalarType;
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;

  RollingCamera(const C& camera, const RollingShutter<S>& shutter) : camera_(camera), shutter_(shutter) {}

  /// Whether rows differ.
  [[nodiscard]] bool moves() const { return shutter_.moves(); }

  [[nodiscard]] std::optional<Vector2> project(const Vector3& p) const {
    return shutter_.project(camera_, p);
  }
  /// @param J  out, d x / d p. The row v = x.y() changes with the point: with J_v = d x / d p_row of the
  /// camera,
  ///           g = J_v d p_row / d v and R_v the rotation from the middle row to row v,
  ///           J = (J_v + g J_v.row(1) / (1 - g.y)) R_v
  [[nodiscard]] std::optional<Vector2> project(const Vector3& p, Eigen::Matrix<S, 2, 3>* J) const {
    if (!shutter_.moves() || J == nullptr) return shutter_.moves() ? project(p) : camera_.project(p, J);
    const auto x = project(p);
    if (!x) return x;
    const S v = x->y();
    const Vector3 p_row = shutter_.to_row(p, v);
    if (!camera_.project(p_row, J)) return std::nullopt;
    const Vector2 g = *J * shutter_.per_row(p_row);
    const S pace = S(1) - g.y();
    for (int i = 0; i < 2; ++i) {
      Vector3 row;  // of the camera's, by the row that shows the point
      for (int k = 0; k < 3; ++k) row(k) = (*J)(i, k);
      if (i == 0) row += (g.x() / pace) * J->row(1).transpose();
      if (i == 1) row /= pace;
      const Vector3 turned = shutter_.turned_to_middle(row, v);
      for (int k = 0; k < 3; ++k) (*J)(i, k) = turned(k);
    }
    return x;
  }
  [[nodiscard]] std::optional<Vector3> unproject(const Vector2& x, const S& z) const {
    const auto p = camera_.unproject(x, z);
    return p && shutter_.moves() ? shutter_.to_middle(*p, x.y()) : p;
  }
  /// The middle row's depth of what a pixel shows at the depth z [m].
  [[nodiscard]] S depth_at_middle(const Vector2& x, const S& z) const {
    const auto p = unproject(x, z);
    return p ? p->z() : z;
  }

  [[nodiscard]] Pinhole<S> pinhole() const { return ideal_pinhole(camera_); }
  /// The pinhole's pixel of what a pixel shows at the depth z [m].
  [[nodiscard]] std::optional<Vector2> undistort_pixel(const Vector2& x, const S& z) const {
    if (!shutter_.moves()) return to_ideal(camera_, pinhole(), x);
    const auto p = unproject(x, z);
    return p ? pinhole().project(*p) : std::nullopt;
  }

 private:
  C camera_;
  RollingShutter<S> shutter_;
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
