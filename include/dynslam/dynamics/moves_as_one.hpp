// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <concepts>
#include <span>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/concepts/image.hpp"
#include "dynslam/dynamics/locate_reference.hpp"
#include "dynslam/dynamics/static_weights.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/optim/pose_consensus.hpp"
#include "dynslam/optim/pose_residual.hpp"

namespace dynslam {

/// Whether keypoints that were found moving share one rigid motion that is not the camera's, as those of a
/// body do. Keypoints on edges of the depth, in shadows and on screens are found moving, too, but each goes
/// its own way.
/// @param matches  of the reference keyframe, on one surface
/// @param T_ref_w  of the reference keyframe
/// @param depth    of the present image [m]
/// @param share    of the matches that must agree; and at most half as many may agree with the camera's
/// motion
template <std::floating_point S, DifferentiableCameraOf<S> Camera, DepthImage D>
[[nodiscard]] bool moves_as_one(const Camera& camera, std::span<const KeypointMatch<S>> matches,
                                const SE3<S>& T_ref_w, const D& depth, const SE3<S>& T_c_w, S share,
                                const LocateOptions<S>& options, LocateWorkspace<S>& ws) {
  const SE3<S> T_w_ref = T_ref_w.inverse();
  ws.observations.clear();
  for (const KeypointMatch<S>& match : matches)
    ws.observations.push_back(reference_observation(match, T_w_ref, depth, options));
  PoseConsensusOptions<S> consensus = options.consensus;
  consensus.prior_share = S(0);  // a body moves as it likes
  const auto own = pose_consensus<S>(camera, ws.observations, {}, T_c_w, {}, consensus, ws.consensus);
  if (!own.ok() || static_cast<S>(own.inliers) < share * static_cast<S>(matches.size())) return false;
  const auto with_camera = std::ranges::count_if(ws.observations, [&](const PoseObservation<S>& o) {
    return observation_chi2(camera, T_c_w, o) < consensus.truncation;
  });
  return 2 * with_camera <= own.inliers;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
