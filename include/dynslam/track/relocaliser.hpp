// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <utility>
#include <vector>

#include "dynslam/features/place_index.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/map/place_verifier.hpp"
#include "dynslam/track/local_map_pose.hpp"

namespace dynslam {

/// Finds a lost camera in the map: the place index names keyframes that look alike, PlaceVerifier proves one
/// of them, and the local map around it gives the pose.
/// @tparam C  the camera as recorded
template <DifferentiableCamera C>
  requires std::floating_point<typename C::ScalarType>
class Relocaliser {
 public:
  using S = typename C::ScalarType;

  Relocaliser(const Pinhole<S>& pinhole, const C& camera, const DepthNoise<S>& noise,
              const PlaceOptions<S>& place, const PoseTrackingOptions<S>& options)
      : verifier_(pinhole, camera, noise, place), options_(options) {}

  /// @param now  has its pose, covariance and matches then; `inliers` stays as it is
  /// @return whether the camera was found
  template <class E>
  bool locate(const E& from, PlaceIndex& places, LocalMapPose<C>& solver, PoseEstimate<S>& now) {
    solver.optimiser().set_rows_known();
    places.query(now.frame, candidates_);
    if (candidates_.size() > static_cast<std::size_t>(options_.candidates))
      candidates_.resize(static_cast<std::size_t>(options_.candidates));
    // The place of last is worth a look even where the index does not name it.
    const int newest = from.map.standing(from.map.newest());
    if (std::none_of(candidates_.begin(), candidates_.end(),
                     [&](const auto& candidate) { return candidate.second == newest; }))
      candidates_.emplace_back(0, newest);
    for (const auto& [votes, keyframe] : candidates_) {
      solver.matcher().clear(now.frame);
      const PlaceResult<S> found = verifier_.verify(from.map, now.frame, from.depth, keyframe);
      if (!found.ok()) continue;
      for (const auto& [feature, point] : found.matches)
        now.frame.point[static_cast<std::size_t>(feature)] = point;
      solver.matcher().match_local(from.map, found.T_c_w, from.pyramid, from.depth, now.frame);
      const PoseResult<S> pose = solver.optimiser().optimize(from.map, found.T_c_w, now.frame);
      if (pose.inliers < 2 * options_.min_inliers || !from.last.reachable(pose.T_c_w, now.frame.t)) continue;
      now.frame.T_c_w = pose.T_c_w;
      now.covariance = pose.covariance;
      return true;
    }
    return false;
  }

 private:
  PlaceVerifier<Pinhole<S>, C> verifier_;
  PoseTrackingOptions<S> options_;
  std::vector<std::pair<int, int>> candidates_;  // votes, keyframe
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
