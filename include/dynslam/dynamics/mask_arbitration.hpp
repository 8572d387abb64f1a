// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "dynslam/geometry/se3.hpp"
#include "dynslam/geometry/small_cholesky.hpp"
#include "dynslam/optim/pose.hpp"

namespace dynslam {

/// Whether a mask of what moves is believed where a pose is estimated, and why not.
enum class MaskVerdict : std::uint8_t {
  kept,
  covers_view,  ///< it leaves next to nothing, which tells less of where the camera is than all does
  starved,      ///< what it leaves does not make a pose, what it covers does
  one_motion    ///< what it covers moves as the room does, and without it the pose is far less certain
};
/// Names of MaskVerdict, in its order.
inline constexpr std::array<std::string_view, 4> kMaskVerdictNames{"kept", "covers_view", "starved",
                                                                   "one_motion"};
/// Name of a verdict.
[[nodiscard]] constexpr std::string_view to_string(MaskVerdict verdict) {
  return kMaskVerdictNames[static_cast<std::size_t>(verdict)];
}

/// When a mask is put to the test, and what it takes to drop it.
template <std::floating_point S>
struct MaskArbitrationOptions {
  S min_left = S(0.2);   ///< share of the features that a mask has to leave, or it is put to the test at once
  int min_inliers = 25;  ///< that make a pose
  S doubt = S(0.6);      ///< share of the matches that fit, below which a mask is put to the test
  S max_loss = S(1.5);   ///< growth of the pose's standard deviation that is accepted without a reason
  S max_chi2 = S(12.59);  ///< 95 % of chi-square with 6 degrees of freedom: one and the same pose
  int young = 8;          ///< frames in which a point was in view, below which it cannot tell of one motion
  // Errors of the map that all matches share, and no covariance of independent ones knows [m, rad].
  S shared_translation = S(0.002), shared_rotation = S(0.001);
};

/// Standard deviation of a pose as the shift of a point 1 m ahead [m].
template <std::floating_point S>
[[nodiscard]] S pose_deviation(const PoseResult<S>& pose) {
  return std::sqrt(pose.covariance.diagonal().sum());
}

/// Judges a mask by the poses with and without it, as Hausman (1978) tests whether the data that an estimator
/// leaves out agree with those it keeps: matches on a mover pull the pose away, farther than chance
/// would; matches on what stands still only make it more certain, and a mask that hides them costs accuracy.
/// @param left  the pose from what the mask leaves
/// @param all   the pose from that and what it covers, both with covariance
template <std::floating_point S>
[[nodiscard]] MaskVerdict arbitrate_mask(const PoseResult<S>& left, const PoseResult<S>& all,
                                         const MaskArbitrationOptions<S>& options = {}) {
  if (!all.ok() || all.inliers < options.min_inliers) return MaskVerdict::kept;  // nothing better is known
  if (!left.ok() || left.inliers < options.min_inliers) return MaskVerdict::starved;
  const S deviation = pose_deviation(left);
  if (!(deviation > options.max_loss * pose_deviation(all))) return MaskVerdict::kept;
  Eigen::Matrix<S, 6, 6> covariance = left.covariance;
  covariance.diagonal().template head<3>().array() += options.shared_translation * options.shared_translation;
  covariance.diagonal().template tail<3>().array() += options.shared_rotation * options.shared_rotation;
  const Eigen::Matrix<S, 6, 1> d = (left.T_c_w * all.T_c_w.inverse()).log();
  SmallCholesky<S, 6> factor;
  if (!factor.compute(covariance)) return MaskVerdict::kept;
  return d.dot(factor.solve(d)) < options.max_chi2 ? MaskVerdict::one_motion : MaskVerdict::kept;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
