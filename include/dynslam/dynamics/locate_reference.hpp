// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cmath>
#include <concepts>
#include <span>
#include <vector>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/concepts/image.hpp"
#include "dynslam/dynamics/static_weights.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/optim/pose.hpp"
#include "dynslam/optim/pose_consensus.hpp"
#include "dynslam/optim/surface_weights.hpp"
#include "dynslam/robust/t_distribution.hpp"

namespace dynslam {

/// Options of locate_reference().
template <std::floating_point S>
struct LocateOptions {
  /// Searches, each from where the one before puts the camera: what the prediction was too far off for is
  /// found then.
  int rounds = 2;
  S sigma_px = S(1);  ///< of a reference keypoint's place in the present image [px]
  /// Sensor noise, and the time between colour and depth image.
  DepthNoise<S> depth_noise{S(0.004), S(0.008)};
  SurfaceOptions<S> surface;
  PoseConsensusOptions<S> consensus{.prior_share = S(0.2)};
  S nu = S(5);  ///< degrees of freedom of the t-distribution that refines the pose
  PoseOptions<S> pose{.min_pixel_scale = S(0.4)};
};

/// Memory of locate_reference(); keep it between calls.
template <std::floating_point S>
struct LocateWorkspace {
  std::vector<PoseObservation<S>> observations, agreeing;  // all, and those that the consensus agrees with
  std::vector<S> weights;
  PoseConsensusWorkspace consensus;
  PoseWorkspace<S> pose;
};

/// What a match of a reference keyframe tells of the present pose, with the depth where that is measured.
/// @param T_w_ref  of the reference keyframe
/// @param depth    of the present image [m]
template <std::floating_point S, DepthImage D>
[[nodiscard]] PoseObservation<S> reference_observation(const KeypointMatch<S>& match, const SE3<S>& T_w_ref,
                                                       const D& depth, const LocateOptions<S>& options) {
  PoseObservation<S> o{T_w_ref * match.p_ref, match.x_m, S(0), S(1) / (options.sigma_px * options.sigma_px),
                       S(0)};
  const int u = static_cast<int>(std::lround(match.x_m.x())),
            v = static_cast<int>(std::lround(match.x_m.y()));
  if (u >= 0 && v >= 0 && u < depth.width() && v < depth.height() && is_valid_depth(depth(u, v))) {
    o.depth = static_cast<S>(depth(u, v));
    o.inv_sigma_z2 = options.depth_noise.information(o.depth);
  }
  return o;
}

namespace detail {
/// What the matches that are not masked tell of the present pose, and the surface that each of them stands
/// for.
template <std::floating_point S, DepthImage D>
void observe_reference(std::span<const KeypointMatch<S>> matches, const SE3<S>& T_ref_w, const D& depth,
                       const SE3<S>& T_c_w_predicted, const LocateOptions<S>& options,
                       LocateWorkspace<S>& workspace) {
  const SE3<S> T_w_ref = T_ref_w.inverse();
  workspace.observations.clear();
  for (const KeypointMatch<S>& match : matches) {
    if (!match.masked)
      workspace.observations.push_back(reference_observation(match, T_w_ref, depth, options));
  }
  surface_weights<S>(depth.width(), depth.height(), T_c_w_predicted, workspace.observations, options.surface,
                     workspace.weights);
}

/// locate_reference() of what observe_reference() left in the workspace.
template <std::floating_point S, DifferentiableCameraOf<S> Camera>
[[nodiscard]] PoseConsensusResult<S> locate_observed(const Camera& camera, const SE3<S>& T_c_w_predicted,
                                                     const LocateOptions<S>& options,
                                                     LocateWorkspace<S>& workspace) {
  auto found = pose_consensus<S>(camera, workspace.observations, workspace.weights, T_c_w_predicted, {},
                                 options.consensus, workspace.consensus);
  if (!found.ok()) return found;
  workspace.agreeing.clear();
  for (std::size_t k = 0; k < workspace.observations.size(); ++k) {
    if (workspace.consensus.inlier[k] != 0) workspace.agreeing.push_back(workspace.observations[k]);
  }
  const PoseResult<S> pose =
      optimize_pose(camera, std::span<const PoseObservation<S>>(workspace.agreeing), found.T_c_w,
                    options.pose, TDistribution<S>::with_dimension(options.nu, 1), workspace.pose);
  if (pose.ok()) found.T_c_w = pose.T_c_w;
  return found;
}
}  // namespace detail

/// The pose that most of the surface agrees on which the matches of a reference keyframe stand for, masked
/// ones left out: pose_consensus() with surface_weights(), then optimize_pose() on those that agree. Unlike a
/// pose that is optimised on everything, it survives a mover with more texture than the room.
/// @param matches  found in the present image, with their points in the reference camera's frame
/// @param T_ref_w  of the reference keyframe
/// @param depth    of the present image [m]
template <std::floating_point S, DifferentiableCameraOf<S> Camera, DepthImage D>
[[nodiscard]] PoseConsensusResult<S> locate_reference(
    const Camera& camera, std::span<const KeypointMatch<S>> matches, const SE3<S>& T_ref_w, const D& depth,
    const SE3<S>& T_c_w_predicted, const LocateOptions<S>& options, LocateWorkspace<S>& workspace) {
  detail::observe_reference(matches, T_ref_w, depth, T_c_w_predicted, options, workspace);
  return detail::locate_observed(camera, T_c_w_predicted, options, workspace);
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
