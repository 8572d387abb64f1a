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
  /// @param J  out, that of the row which shows the point; that the row changes with the point is left out,
  ///           a twentieth in a turn of 2 rad/s
  [[nodiscard]] std::optional<Vector2> project(const Vector3& p, Eigen::Matrix<S, 2, 3>* J) const {
    if (!shutter_.moves() || J == nullptr) return shutter_.moves() ? project(p) : camera_.project(p, J);
    const auto x = project(p);
    return x ? camera_.project(shutter_.to_row(p, x->y()), J) : x;
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
