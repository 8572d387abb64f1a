// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <pybind11/pybind11.h>

#include <string>
#include <vector>

#include "dynslam/eval/trajectory.hpp"

namespace dynslam::python {

/// Poses with their times, as Python has them.
struct Trajectory {
  std::vector<StampedPose<double>> poses;
  std::string name = "trajectory";  ///< for messages
};

}  // namespace dynslam::python
