// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>

namespace dynslam::runtime {

/// What happens when the camera is lost for long: a new map is begun, and joined to the main one as soon as
/// both know the camera's place.
struct NewMapOptions {
  bool begin = true;
  /// Time that the camera is lost before [s]: most covers and jolts are over by then, and the place of last
  /// is still in view or near.
  double after = 3;
  int agreeing =
      3;  ///< frames in a row in which both maps have a pose and agree where the one lies in the other
  double agreement = 0.05;  ///< distance between two such placings of the camera [m]: what a pose found by a
                            ///< place errs by is a third of it
  double agreement_turn = 0.05;  ///< and turn [rad]
  int patience = 60;  ///< frames in which they may disagree before the new map is left alone until a keyframe
  std::size_t scans = 200;  ///< of a new map's keyframes that are kept for the octree (3 MB each at 640x480)
};

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
