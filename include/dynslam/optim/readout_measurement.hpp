// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/config.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/geometry/small_cholesky.hpp"
#include "dynslam/optim/pose_residual.hpp"
#include "dynslam/robust/block_jackknife.hpp"

namespace dynslam {

/// What one image says of the readout time: information [1/s^2] and that times the correction [1/s].
template <std::floating_point S>
struct ReadoutImage {
  double t = 0;  ///< of the image [s]
  S information = S(0), sum = S(0);
};

/// A readout time with its uncertainty [s].
template <std::floating_point S>
struct ReadoutEstimate {
  S time = S(0);
  S half_width = std::numeric_limits<S>::infinity();  ///< of the 95 % interval
};

/// Measures how long a camera with a rolling shutter takes to read its rows, from what poses leave
/// unexplained: beside the six numbers of each image's pose, one number of all images is estimated, by which
/// rows are sheared in the direction in which the camera moves. Linear, in one pass; keeps three numbers of
/// each image.
///
/// A map that was made with the assumed time explains most of the shear, so that the correction is too small
/// by some factor; its sign, and where it is zero, do not suffer: readout_between() two measurements.
template <std::floating_point S>
class ReadoutMeasurement {
 public:
  using Vector6 = Eigen::Matrix<S, 6, 1>;

  /// One image. Call observe() for what it sees, then end_image().
  /// @param t      of the image [s], later than that of the one before
  /// @param speed  of the camera, left: p_c' = omega x p_c + upsilon [m/s, rad/s]
  void begin_image(double t, const SE3<S>& T_c_w, const Vector6& speed) {
    t_ = t;
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
    images_.push_back({t_, own_ - across_.dot(moved), b_.dot(moved) - force_});
    information_ += images_.back().information;
    sum_ += images_.back().sum;
  }

  /// Readout time less the assumed one [s].
  [[nodiscard]] S correction() const { return information_ > S(0) ? sum_ / information_ : S(0); }
  /// Its standard deviation by the scatter of the residuals alone [s], as if each had an error of its own;
  /// infinite where nothing was measured. Points of a map that are off, and speeds, are off in many images
  /// alike: see interval().
  [[nodiscard]] S sigma() const {
    using std::sqrt;
    if (!(information_ > S(0))) return std::numeric_limits<S>::infinity();
    return sqrt(error_ / (S(rows_) * information_));
  }
  /// correction() with what its scatter over segments of the sequence says of its error (block_jackknife()).
  [[nodiscard]] ReadoutEstimate<S> interval() const {
    return {correction(), block_jackknife<S>(images_.size(), [&](std::size_t first, std::size_t end) {
              S information = information_, sum = sum_;
              for (std::size_t i = first; i < end; ++i) {
                information -= images_[i].information;
                sum -= images_[i].sum;
              }
              return sum / information;
            })};
  }
  /// In the order of time.
  [[nodiscard]] std::span<const ReadoutImage<S>> images() const { return images_; }

 private:
  [[nodiscard]] static bool is_finite(const S& value) {
    using std::isfinite;
    return isfinite(value);
  }

  double t_ = 0;
  SE3<S> T_c_w_;
  Vector6 speed_ = Vector6::Zero();
  Eigen::Matrix<S, 6, 6> H_ = Eigen::Matrix<S, 6, 6>::Zero();
  Vector6 b_ = Vector6::Zero(), across_ = Vector6::Zero();
  S own_ = S(0), force_ = S(0);                       // of the image
  S information_ = S(0), sum_ = S(0), error_ = S(0);  // of all
  std::size_t rows_ = 0;
  std::vector<ReadoutImage<S>> images_;
};

/// The readout time at which a sequence needs no correction, by the line through its measurements with two
/// assumed times. Both share the images, and most of their errors; the interval is of the time itself, by
/// leaving segments out of both (block_jackknife()).
/// @param low, high  measurements of the same sequence as if rows took `assumed_low` and `assumed_high` [s],
///                   assumed_low < assumed_high (asserted)
/// @return  nullopt where the longer time does not ask for a smaller correction: rows say nothing
template <std::floating_point S>
[[nodiscard]] std::optional<ReadoutEstimate<S>> readout_between(const ReadoutMeasurement<S>& low,
                                                                S assumed_low,
                                                                const ReadoutMeasurement<S>& high,
                                                                S assumed_high) {
  DYNSLAM_ASSERT(assumed_low < assumed_high, "two assumed times");
  if (low.images().empty() || high.images().empty()) return std::nullopt;
  // @param from, to  what is left out [s]
  const auto correction = [](const ReadoutMeasurement<S>& m, double from, double to) {
    S information = S(0), sum = S(0);
    for (const ReadoutImage<S>& image : m.images()) {
      if (from <= image.t && image.t < to) continue;
      information += image.information;
      sum += image.sum;
    }
    return sum / information;
  };
  const auto time = [&](double from, double to) {
    const S at_low = correction(low, from, to), at_high = correction(high, from, to);
    return assumed_low + at_low * (assumed_high - assumed_low) / (at_low - at_high);
  };
  if (!(low.correction() > high.correction())) return std::nullopt;
  ReadoutEstimate<S> result;
  result.time = time(0, 0);
  const std::span<const ReadoutImage<S>> images = low.images();
  result.half_width = block_jackknife<S>(images.size(), [&](std::size_t first, std::size_t end) {
    return time(images[first].t, end < images.size() ? images[end].t : std::numeric_limits<double>::max());
  });
  return result;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
