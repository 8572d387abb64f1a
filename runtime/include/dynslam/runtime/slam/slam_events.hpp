// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <functional>

#include "dynslam/geometry/se3.hpp"
#include "dynslam/runtime/slam/types.hpp"

namespace dynslam::runtime {

/// A new keyframe in the map.
struct KeyframeEvent {
  int id = 0;    ///< in Slam::map(), counted from 0
  double t = 0;  ///< time of its frame [s]
  SE3<double> T_w_c;
};

/// A loop was closed: poses and points of the whole map may have moved.
struct LoopEvent {
  double t = 0;         ///< time of the frame that saw the place again [s]
  LoopClosing closing;  ///< its two keyframes and the correction
};

/// A bundle adjustment was used: poses of the newest keyframes and their points have moved.
struct AdjustedEvent {
  double t = 0;    ///< time of the frame at which it joined [s]
  int newest = 0;  ///< id of the newest keyframe then
};

/// The first frame of a loss, or of those that do not find themselves in a map that was loaded.
struct LostEvent {
  double t = 0;  ///< its time [s]
};

/// The frame that ends a loss, or the first one that finds itself in a map that was loaded.
struct FoundEvent {
  double t = 0;              ///< its time [s]
  std::size_t frames = 0;    ///< without a pose before it
  bool relocalised = false;  ///< by a place that was recognised; else where the motion led
  SE3<double> T_w_c;
};

/// The camera has been lost for long, and a map of its own was begun; see NewMapOptions.
struct MapBegunEvent {
  double t = 0;  ///< time of its first frame [s]
  int map = 0;   ///< its number, from 2
};

/// Such a map has become part of the main one: the place was recognised.
struct MapJoinedEvent {
  double t = 0;  ///< [s]
  int map = 0;
  std::size_t frames = 0;    ///< which trajectory() has from now on
  SE3<double> T_w_separate;  ///< where its world lies in the main one
};

/// What a system says of itself, beside each frame's result. The functions are called on the thread that
/// calls track() or finish(), at the end of that call, in this order: adjusted, lost or found, keyframe,
/// loop, map_begun, map_joined. The same frames give the same calls. A function may look at the system, and
/// must not track, finish, load or reset it (UsageError). What it throws leaves track(): the map is whole and
/// has the frame, whose result is lost; events that were not told yet come with the next call.
struct SlamEvents {
  std::function<void(const KeyframeEvent&)> keyframe{};
  std::function<void(const LoopEvent&)> loop{};
  std::function<void(const AdjustedEvent&)> adjusted{};
  std::function<void(const LostEvent&)> lost{};
  std::function<void(const FoundEvent&)> found{};
  std::function<void(const MapBegunEvent&)> map_begun{};
  std::function<void(const MapJoinedEvent&)> map_joined{};
};

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
