// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <vector>

#include "dynslam/geometry/se3.hpp"
#include "dynslam/map/feature_frame.hpp"
#include "dynslam/map/keyframe_map.hpp"

namespace dynslam {

/// When a keyframe of the map stands for a frame, so that a new one would tell nothing.
template <std::floating_point S = double>
struct CoverageOptions {
  S translation = S(0.10);  ///< between the two [m]: well within KeyframeOptions, so that both see the same
  S rotation = S(0.15);     ///< [rad]
  S seen = S(0.6);          ///< matches of the frame, as a share of the points that the keyframe shows
  S shared = S(0.5);        ///< of what shows less, the frame's matches or the keyframe, that both show
  int min_matches = 150;    ///< of the frame: with fewer the place needs more points, whoever stands there
};

/// The keyframe that stands for a frame: near it, with most points in common (ties: newer).
/// @param frame  tracked: its matches are points of the map, those on moving objects are not counted
/// @param votes  scratch memory
/// @return its id; -1: the frame shows what no keyframe does
template <std::floating_point S, class Patch>
[[nodiscard]] int covering_keyframe(const KeyframeMap<S, Patch>& map, const FeatureFrame<S>& frame,
                                    const CoverageOptions<S>& options, std::vector<int>& votes) {
  int matches = 0;
  for (std::size_t i = 0; i < frame.point.size(); ++i)
    matches += frame.point[i] >= 0 && frame.dynamic[i] == 0 ? 1 : 0;
  if (matches < options.min_matches) return -1;
  votes.assign(map.keyframes().size(), 0);
  map.count_shared(frame.point, votes);
  int best = -1, most = 0;
  for (const auto& k : map.keyframes()) {
    const int shared = votes[static_cast<std::size_t>(k.id)];
    if (k.culled() || shared == 0 || shared < most) continue;
    const SE3<S> motion = frame.T_c_w * k.frame.T_c_w.inverse();
    if (motion.translation().norm() > options.translation || motion.so3().log().norm() > options.rotation)
      continue;
    int points = 0;
    for (const int p : k.frame.point) points += p >= 0 && !map.point(p).bad ? 1 : 0;
    if (static_cast<S>(matches) < options.seen * static_cast<S>(points)) continue;
    // Of many keyframes in one place none shows all that a frame finds there.
    if (static_cast<S>(shared) < options.shared * static_cast<S>(std::min(matches, points))) continue;
    best = k.id;
    most = shared;
  }
  return best;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
