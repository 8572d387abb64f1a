// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include "dynslam/optim/trajectory_smoothing.hpp"

namespace dynslam::runtime {

/// How the poses of all frames are brought together in the end (smooth_trajectory()).
struct TrajectoryOptions : SmoothingOptions {
  bool smooth = true;  ///< not with MotionMethod::paper, whatever this says
};

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
