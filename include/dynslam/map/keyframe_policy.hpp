// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cmath>
#include <concepts>

#include "dynslam/geometry/se3.hpp"

namespace dynslam {

/// When a frame is worth keeping. Gaps are in frames of 1/30 s, see frames_of_30_hz().
template <std::floating_point S>
struct KeyframeOptions {
  int urgent = 100;         ///< matches of the map below which the map in view runs out: no waiting then
  int min_gap = 6;          ///< frames between two keyframes that nothing hurries
  int max_gap = 30;         ///< frames after which there is one in any case
  S ratio = S(0.6);         ///< of the points that the last keyframe saw: with fewer it has been left behind
  S translation = S(0.15);  ///< from the last keyframe [m]: patches and depth get worse with the distance
  S rotation = S(0.20);     ///< [rad]
};

/// What the decision is made from.
template <std::floating_point S>
struct KeyframeEvidence {
  int frames = 0;       ///< since the last keyframe, of 1/30 s
  int inliers = 0;      ///< matches of the map that fit the frame's pose
  int points_then = 0;  ///< with a match in the last keyframe, those it made included
  SE3<S> T_c_keyframe;  ///< motion since
};

/// What gaps are counted in: how many frames a camera of 30 Hz would have taken in the time of `frames`
/// frames. From 20 to 45 Hz a frame is a frame, so that single ones that a camera drops change nothing.
/// @param seconds  that they took
[[nodiscard]] inline int frames_of_30_hz(int frames, double seconds) {
  const double each = 30 * seconds / frames;
  return frames < 1 || !(each < 2.0 / 3 || (each > 1.5 && each < 1e6))
             ? frames
             : static_cast<int>(std::lround(30 * seconds));
}

/// Whether a tracked frame becomes a keyframe.
template <std::floating_point S>
[[nodiscard]] bool wants_keyframe(const KeyframeEvidence<S>& seen, const KeyframeOptions<S>& options = {}) {
  if (seen.inliers < options.urgent) return true;
  if (seen.frames < options.min_gap) return false;
  if (seen.frames >= options.max_gap) return true;
  if (static_cast<S>(seen.inliers) < options.ratio * static_cast<S>(seen.points_then)) return true;
  return seen.T_c_keyframe.translation().norm() > options.translation ||
         seen.T_c_keyframe.so3().log().norm() > options.rotation;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
