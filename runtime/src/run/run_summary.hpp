// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/run/run_sequence.hpp"

namespace dynslam::runtime {

/// summary.json: what a run did, what it was asked for and what it was built with.
[[nodiscard]] std::string summary_json(const RunOptions& options, const CameraConfig& camera,
                                       const RunSummary& summary);

}  // namespace dynslam::runtime
