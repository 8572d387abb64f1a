// SPDX-License-Identifier: BSD-3-Clause
// Options of what gives a-priori masks: a network or files.
#pragma once

#include <CLI/CLI.hpp>

#include "dynslam/runtime/run/run_sequence.hpp"

namespace dynslam::app {

void add_segmentation_options(CLI::App& app, runtime::SegmentationStageOptions& options);
void add_mask_options(CLI::App& app, runtime::RunOptions& options);
/// @throws UsageError  an option of both on the command line that nothing would use
void check_used(const CLI::App& app, const runtime::RunOptions& options);

}  // namespace dynslam::app
