// SPDX-License-Identifier: BSD-3-Clause
// Ground truths that are poses of a body to which the camera is fixed. Internal to the evaluation.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "dynslam/eval/trajectory.hpp"

namespace dynslam::runtime {

/// The camera's pose on the body: four rows of a matrix, or "tx ty tz qx qy qz qw". @throws InputError
[[nodiscard]] SE3<double> read_body_pose(const std::filesystem::path& file);
/// Poses of the camera from those of the body.
void apply_body_pose(const SE3<double>& T_body_camera, std::vector<StampedPose<double>>& truth);

/// Turns a ground truth that lies as a file in a folder of Bonn's, and says so.
void turn_bonn_file(const std::filesystem::path& file, std::vector<StampedPose<double>>& truth,
                    std::vector<std::string>& notes);

/// Says where positions agree and motions do not because the ground truth's body is turned against the
/// camera.
void note_turned_body(std::span<const StampedPose<double>> estimate,
                      std::span<const StampedPose<double>> groundtruth, const AteResult<double>& ate,
                      const RpeResult<double>& rpe, std::vector<std::string>& notes);

}  // namespace dynslam::runtime
