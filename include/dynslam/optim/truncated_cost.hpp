// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <optional>
#include <span>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/optim/pose_residual.hpp"

namespace dynslam {

/// What a pose costs, and how many observations it explains.
template <Scalar S>
struct TruncatedCost {
  S cost = S(0);    ///< sum of w min(truncation, squared normalised error)
  int inliers = 0;  ///< observations below the truncation
};

/// The cost by which consensus compares poses: an outlier costs the same however far it is off (MSAC, Torr
/// and Zisserman 2000).
/// @param truncation  squared normalised error beyond which an observation counts as an outlier
/// @param weight      of an observation by its index, >= 0
/// @param start       cost before the first observation
/// @param most        nullopt is returned, the rest unseen, as soon as the cost is not below it
template <std::floating_point S, CameraOf<S> Camera, class Weight>
[[nodiscard]] std::optional<TruncatedCost<S>> truncated_cost(const Camera& camera, const SE3<S>& T_c_w,
                                                             std::span<const PoseObservation<S>> observations,
                                                             S truncation, const Weight& weight, S start,
                                                             S most) {
  const auto motion = T_c_w.isometry();
  TruncatedCost<S> sum{start, 0};
  for (std::size_t k = 0; k < observations.size(); ++k) {
    const S e = std::min(truncation, observation_chi2(camera, motion, observations[k]));
    sum.inliers += e < truncation ? 1 : 0;
    sum.cost += weight(k) * e;
    if (sum.cost >= most) return std::nullopt;
  }
  if (sum.cost >= most) return std::nullopt;
  return sum;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
