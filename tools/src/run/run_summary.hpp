// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/run/run_sequence.hpp"

namespace dynslam::runtime {

/// summary.json: what a run did, what it was asked for and what it was built with.
[[nodiscard]] std::string summary_json(const RunOptions& options, const CameraConfig& camera,
                                       const RunSummary& summary);

/// Frames without a pose: time [s], place among the problems; in order.
using LostFrames = std::vector<std::pair<double, std::size_t>>;

/// Takes frames that have a pose in the trajectory after all out of the problems.
void drop_found(const LostFrames& lost, RunSummary& summary);

/// Warns of results of an earlier run that this one does not replace: they are the user's to remove.
void note_leftovers(const RunOptions& options, RunSummary& summary);

/// @throws InputError where more frames are broken than RunOptions::max_broken allows
void check_broken(const RunOptions& options, const RunSummary& summary);
/// @param any_depth  whether a depth image had a valid depth
/// @throws InputError with the reason why no frame has a pose
[[noreturn]] void refuse_without_poses(const RunOptions& options, const RunSummary& summary, bool any_depth);

}  // namespace dynslam::runtime
