// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/optim/pose_residual.hpp"
#include "dynslam/optim/small_cholesky.hpp"

namespace dynslam {

/// Measures how long a camera with a rolling shutter takes to read its rows, from what poses leave
/// unexplained: beside the six numbers of each image's pose, one number of all images is estimated, by which
/// rows are sheared in the direction in which the camera moves. Linear, in one pass, without memory.
///
/// A map that was made with the assumed time explains a part of the shear, so that the correction is too
/// small by some factor; its sign, and where it is zero, do not suffer. Readings at two times give the third.
template <std::floating_point S>
class ReadoutMeasurement {
 public:
  using Vector6 = Eigen::Matrix<S, 6, 1>;

  /// One image. Call observe() for what it sees, then end_image().
  /// @param speed  of the camera, left: p_c' = omega x p_c + upsilon [m/s, rad/s]
  void begin_image(const SE3<S>& T_c_w, const Vector6& speed) {
    T_c_w_ = T_c_w;
    speed_ = speed;
    H_.setZero();
    b_.setZero();
    across_.setZero();
    own_ = force_ = S(0);
  }
  /// An observation with NaN or infinity in it is left out: the sums of all images would never lose it.
  /// @param o       placed as if the readout took the time that was assumed
  /// @param weight  robust weight at the pose
  /// @param share   of the readout between the middle row and the observation's: -0.5 to 0.5
  template <DifferentiableCameraOf<S> Camera>
  void observe(const Camera& camera, const PoseObservation<S>& o, const S& weight, const S& share) {
    Eigen::Matrix<S, 3, 1> r;
    Eigen::Matrix<S, 3, 6> J;
    if (!pose_residual(camera, T_c_w_, o, r, &J)) return;
    for (int row = 0; row < 3; ++row) {
      if (row == 2 && !measures_depth(o)) continue;
      const S information = weight * (row < 2 ? o.inv_sigma_px2 : o.inv_sigma_z2);
      S shear = S(0);  // of the row by a second of readout
      for (int i = 0; i < 6; ++i) shear += J(row, i) * speed_(i);
      shear *= share;
      if (!is_finite(information * (shear * shear + r(row) * r(row)))) continue;
      for (int i = 0; i < 6; ++i) {
        const S weighted = information * J(row, i);
        for (int j = 0; j <= i; ++j) H_(i, j) += weighted * J(row, j);
        b_(i) += weighted * r(row);
        across_(i) += weighted * shear;
      }
      own_ += information * shear * shear;
      force_ += information * shear * r(row);
      error_ += information * r(row) * r(row);
      ++rows_;
    }
  }
  /// Adds what is left when the pose has taken its part.
  void end_image() {
    SmallCholesky<S, 6> pose;
    if (!pose.compute(H_)) return;
    const Vector6 moved = pose.solve(across_);
    information_ += own_ - across_.dot(moved);
    sum_ -= force_ - b_.dot(moved);
  }

  /// Readout time less the assumed one [s].
  [[nodiscard]] S correction() const { return information_ > S(0) ? sum_ / information_ : S(0); }
  /// Its standard deviation by the scatter of the residuals [s]; infinite where nothing was measured.
  [[nodiscard]] S sigma() const {
    using std::sqrt;
    if (!(information_ > S(0))) return std::numeric_limits<S>::infinity();
    return sqrt(error_ / (S(rows_) * information_));
  }

 private:
  [[nodiscard]] static bool is_finite(const S& value) {
    using std::isfinite;
    return isfinite(value);
  }

  SE3<S> T_c_w_;
  Vector6 speed_ = Vector6::Zero();
  Eigen::Matrix<S, 6, 6> H_ = Eigen::Matrix<S, 6, 6>::Zero();
  Vector6 b_ = Vector6::Zero(), across_ = Vector6::Zero();
  S own_ = S(0), force_ = S(0);                       // of the image
  S information_ = S(0), sum_ = S(0), error_ = S(0);  // of all
  std::size_t rows_ = 0;
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
