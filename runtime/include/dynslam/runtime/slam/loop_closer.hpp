// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/geometry/brown_conrady.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/map/loop_closer.hpp"
#include "dynslam/runtime/slam/local_map.hpp"

namespace dynslam::runtime {

using LoopOptions = dynslam::LoopOptions<double>;
using LoopClosing = dynslam::LoopClosing<double>;
using LoopCloser = dynslam::LoopCloser<Pinhole<double>, PinholeBrownConrady<double>>;

}  // namespace dynslam::runtime
