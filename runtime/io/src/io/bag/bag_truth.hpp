// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "dynslam/eval/trajectory.hpp"
#include "io/bag/bag_survey.hpp"

namespace dynslam::runtime::bag {

struct BagTruth {
  std::vector<StampedPose<double>> poses;  ///< camera to world
  std::string source;                      ///< of the poses: topic and frames
  std::string missing;                     ///< why there are none
};

/// The true poses of a camera's frame: where the tree of transforms moves it by one transform, the others
/// standing still (TUM's bags: world -> kinect is measured, kinect -> ... -> the camera is not), else the
/// only topic of poses, which are taken for the camera's unless they name another frame.
[[nodiscard]] BagTruth truth_of(const BagSurvey& survey, const std::string& camera_frame);

}  // namespace dynslam::runtime::bag
