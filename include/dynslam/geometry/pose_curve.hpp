// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <span>

#include "dynslam/concepts/scalar.hpp"
#include "dynslam/config.hpp"
#include "dynslam/geometry/se3.hpp"

namespace dynslam {

/// A pose at a time.
template <Scalar S>
struct TimedPose {
  double t = 0;  ///< [s]
  SE3<S> T;
};

/// The motion through a few poses: a polynomial in the tangent space of the one that is nearest in time
/// (Lagrange's form), of the order that they allow: through two at constant velocity, through three at
/// constant acceleration. Meant for two to four poses over which the camera turns by much less than half a
/// turn; beyond the outermost of them it runs away.
/// @param poses  one or more, at times that differ, in any order
/// @return the pose at time t [s]
template <Scalar S>
[[nodiscard]] SE3<S> pose_between(std::span<const TimedPose<S>> poses, double t) {
  DYNSLAM_ASSERT(!poses.empty(), "a motion goes through poses");
  const auto away = [t](const TimedPose<S>& pose) { return pose.t < t ? t - pose.t : pose.t - t; };
  const TimedPose<S>* nearest = &poses.front();
  for (const TimedPose<S>& pose : poses) {
    if (away(pose) < away(*nearest)) nearest = &pose;
  }
  const SE3<S> from_nearest = nearest->T.inverse();
  typename SE3<S>::Vector6 xi = SE3<S>::Vector6::Zero();
  for (const TimedPose<S>& pose : poses) {
    double weight = 1;
    for (const TimedPose<S>& other : poses)
      if (&other != &pose) weight *= (t - other.t) / (pose.t - other.t);
    xi += S(weight) * (pose.T * from_nearest).log();
  }
  return SE3<S>::exp(xi) * nearest->T;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
