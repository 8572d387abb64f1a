// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>
#include <vector>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/config.hpp"
#include "dynslam/dynamics/mask_arbitration.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/map/feature_frame.hpp"
#include "dynslam/map/matched_pose.hpp"
#include "dynslam/optim/pose.hpp"

namespace dynslam {

/// A pose, and the mask that was believed for it.
template <std::floating_point S>
struct MaskedPoseResult {
  PoseResult<S> pose;
  std::size_t mask = 0;                     ///< the one that was believed; as many as there are: none of them
  MaskVerdict verdict = MaskVerdict::kept;  ///< on the first mask
  [[nodiscard]] bool ok() const { return pose.ok(); }
};

/// Memory of masked_pose; keep it between calls to avoid allocation.
struct MaskedPoseWorkspace {
  std::vector<int> point, all_point;
};

/// The pose of a frame on what a mask leaves, or on more where the mask is not to be believed
/// (arbitrate_mask()). `frame.dynamic` is that of the mask that was believed afterwards, and matches on it
/// are gone; without any, all flags are zero.
/// @param masks  flags of the features, one vector per mask; the first is believed unless the others fare
/// better
/// @param forget forget(point id): called for each match on the mask that was believed
template <class Map, std::floating_point S, class Camera, class Forget>
MaskedPoseResult<S> masked_pose(MatchedPose<S, Camera>& estimator, const Map& map,
                                const SE3<std::type_identity_t<S>>& start,
                                std::span<const std::vector<std::uint8_t>> masks,
                                const MaskArbitrationOptions<std::type_identity_t<S>>& options,
                                FeatureFrame<S>& frame, Forget&& forget, MaskedPoseWorkspace& ws) {
  MaskedPoseResult<S> result;
  ws.point = frame.point;
  const auto matches = std::count_if(ws.point.begin(), ws.point.end(), [](int p) { return p >= 0; });
  const auto estimate = [&](std::size_t k) {
    frame.point = ws.point;
    if (k < masks.size()) {
      DYNSLAM_ASSERT(masks[k].size() == frame.features.size(), "one flag per feature");
      frame.dynamic = masks[k];
    } else {
      frame.dynamic.assign(frame.features.size(), 0);
    }
    return estimator.optimize(map, start, frame);
  };
  // Points made a moment ago are where they are seen, whatever they move with.
  const auto mostly_young = [&](std::size_t k) {
    int young = 0, old = 0;
    for (std::size_t i = 0; i < ws.point.size(); ++i) {
      if (ws.point[i] < 0 || masks[k][i] == 0) continue;
      ++(map.point(ws.point[i]).visible < options.young ? young : old);
    }
    return young > old;
  };
  PoseResult<S> all;
  for (; result.mask < masks.size(); ++result.mask) {
    result.pose = estimate(result.mask);
    // Where most matches fit there is nothing to gain, which is the usual case.
    if (result.pose.ok() && result.pose.inliers >= options.min_inliers &&
        static_cast<S>(result.pose.inliers) >= options.doubt * static_cast<S>(matches))
      break;
    if (result.mask == 0) {
      ws.all_point = frame.point;
      all = estimate(masks.size());
      std::swap(ws.all_point, frame.point);
    }
    MaskVerdict verdict = arbitrate_mask(result.pose, all, options);
    if (verdict == MaskVerdict::one_motion && mostly_young(result.mask)) verdict = MaskVerdict::kept;
    if (result.mask == 0) result.verdict = verdict;
    if (verdict == MaskVerdict::kept) break;
  }
  if (result.mask == masks.size()) {
    result.pose = masks.empty() ? estimate(0) : all;
    if (!masks.empty()) frame.point = ws.all_point;
    frame.dynamic.assign(frame.features.size(), 0);
    return result;
  }
  frame.dynamic = masks[result.mask];
  for (std::size_t i = 0; i < frame.point.size(); ++i) {
    if (frame.dynamic[i] == 0 || frame.point[i] < 0) continue;
    forget(frame.point[i]);
    frame.point[i] = -1;
  }
  return result;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
