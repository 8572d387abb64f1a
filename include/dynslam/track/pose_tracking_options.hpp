// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <concepts>
#include <cstddef>

namespace dynslam {

/// How a pose is found between two frames and proven by the local map, while the camera is known, once it is
/// lost, and afterwards. Lengths in metres, times in seconds.
template <std::floating_point S>
struct PoseTrackingOptions {
  int min_inliers = 25;        ///< fewer: the pose is not accepted
  int weak_inliers = 8;        ///< of the last frame's points: a start whose proof is the local map
  int sure_inliers = 50;       ///< of them: with fewer the local map is matched again from the pose it gave
  int settling_passes = 4;     ///< so often at most,
  S settling_growth = S(1.1);  ///< and again only where the inliers became so many times as many
  int coasting_frames = 3;     ///< lost for fewer: the motion that was is tried before the places
  float near_radius = 12.0F,
        far_radius = 30.0F;  ///< of the search for the last frame's points [px of their level]
  bool aligned_starts = true;   ///< where few features lead from the last frame, its grey values are a start
  bool surface_weights = true;  ///< matches count by the surface that they stand for (surface_weights())
  S prior_share = S(0.2);    ///< the predicted motion counts as this share of all matches
  S prior_speed = S(0.9);    ///< standard deviation of the change of velocity between two frames [m/s]
  S prior_turn = S(0.9);     ///< and of the angular velocity's [rad/s]
  bool strict_local_map = true;  ///< matches of the local map that are far off never enter the optimisation
  S local_chi2 = S(25);      ///< squared normalised error from which a match of the local map is dropped
  int candidates = 5;        ///< keyframes tried per lost frame
  S max_speed = S(4);        ///< of a hand [m/s]: farther, a place that looks right is another one
  S max_turn = S(8);         ///< [rad/s]
  /// How well the motion between frames tells the camera's turn while it reads its rows, a standard deviation
  /// [rad/s]; 0: it is taken for it. A hand's is ten times as large, but matches err together (lens, map),
  /// and a turn that is free takes the map's errors up: people 8.3 mm with 0.3, 5.3 with this, 6.0 with 0.
  S turn_doubt = S(0.02);
  bool revise = true;  ///< place a frame once more by the motion that the next one tells; rolling shutters
  std::size_t young_frames = 10;  ///< of a map, in which what lies behind is asked, too; 0: never
  /// Share of a pose's matches on the foreground, up to which the background is not asked: 0.58 of those of a
  /// pose that follows a board, 0.16 at most of one that does not.
  S foreground_share = S(0.25);
  double longest_delay = 0.05;  ///< of a depth image, over which the velocity is trusted [s]

  /// Between two frames, below which they tell how the camera moved while they were taken [s].
  [[nodiscard]] double longest_motion() const { return 4 * longest_delay; }
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
