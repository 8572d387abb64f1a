// SPDX-License-Identifier: BSD-3-Clause
// Options of what gives a-priori masks: a network or files.
#pragma once

#include <CLI/CLI.hpp>

#include "dynslam/runtime/run/run_sequence.hpp"

namespace dynslam::app {

void add_segmentation_options(CLI::App& app, runtime::SegmentationStageOptions& options);
void add_mask_options(CLI::App& app, runtime::RunOptions& options);

}  // namespace dynslam::app
