// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/concepts/scalar.hpp"
#include "dynslam/config.hpp"

namespace dynslam {

/// A camera that moves while it reads its image row by row. Each row has a pose of its own then; this brings
/// points from one to another, where "the pose of the image" is that of its middle row.
///
/// The camera turns and goes evenly while it reads. Motions are expanded to second order: of a turn by 3
/// degrees between the middle row and the last, what is left out is a hundredth of a pixel of a focal length
/// of 500.
template <Scalar S>
class RollingShutter {
 public:
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  using Vector6 = Eigen::Matrix<S, 6, 1>;

  /// All rows at once (a global shutter), or a camera at rest.
  RollingShutter() = default;
  /// @param motion  from the first row to the last, as SE3::log() of T_last_first [m, rad]
  /// @param height  rows of the image, at least 2 (asserted)
  RollingShutter(const Vector6& motion, int height)
      : upsilon_(motion[0], motion[1], motion[2]),
        omega_(motion[3], motion[4], motion[5]),
        middle_(S(height - 1) / S(2)),
        per_row_(S(1) / S(height - 1)),
        moves_(true) {
    DYNSLAM_ASSERT(height >= 2, "an image that is read row by row needs two rows");
  }

  /// Whether rows differ.
  [[nodiscard]] bool moves() const { return moves_; }
  /// From the first row to the last: p' = p + omega x p + upsilon to first order [m, rad].
  [[nodiscard]] const Vector3& upsilon() const { return upsilon_; }
  [[nodiscard]] const Vector3& omega() const { return omega_; }

  /// The same camera, turned by so much more from the first row to the last [rad].
  [[nodiscard]] RollingShutter turned(const Vector3& turn) const {
    RollingShutter result = *this;
    result.omega_ += turn;
    return result;
  }
  /// Row `v`, counted from the middle one, as a share of all: -0.5 to 0.5; 0 where all are read at once.
  [[nodiscard]] S share(const S& v) const { return (v - middle_) * per_row_; }

  /// A point in the camera's frame when it read row `v`, in its frame when it read the middle row.
  [[nodiscard]] Vector3 to_middle(const Vector3& p_row, const S& v) const {
    return moves_ ? moved(p_row, (middle_ - v) * per_row_) : p_row;
  }
  /// A point in the camera's frame when it read the middle row, in its frame when it read row `v`.
  [[nodiscard]] Vector3 to_row(const Vector3& p_middle, const S& v) const {
    return moves_ ? moved(p_middle, share(v)) : p_middle;
  }

  /// The pixel that shows a point: the row that reads it is the one in which it is then.
  /// @param p_middle  in the camera's frame when it read the middle row [m]
  template <CameraOf<S> C>
  [[nodiscard]] std::optional<Vector2> project(const C& camera, const Vector3& p_middle) const {
    std::optional<Vector2> x = camera.project(p_middle);
    constexpr int kSteps = 3;  // each leaves a twentieth, in a turn of 2 rad/s
    for (int i = 0; moves_ && x && i < kSteps; ++i) x = camera.project(to_row(p_middle, x->y()));
    return x;
  }

 private:
  /// exp(share motion) p.
  [[nodiscard]] Vector3 moved(const Vector3& p, const S& share) const {
    const Vector3 first = share * (omega_.cross(p) + upsilon_);
    return p + first + (share / S(2)) * omega_.cross(first);
  }

  Vector3 upsilon_ = Vector3::Zero(), omega_ = Vector3::Zero();
  S middle_ = S(0), per_row_ = S(0);
  bool moves_ = false;
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
