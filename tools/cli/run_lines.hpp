// SPDX-License-Identifier: BSD-3-Clause
// What `run` and `ablate` say of a run.
#pragma once

#include <filesystem>
#include <string>

#include "dynslam/runtime/run/run_sequence.hpp"

namespace dynslam::app {

/// One line on stderr for all frames without a pose; summary.json lists every one.
void report_problems(const runtime::RunSummary& summary, const std::filesystem::path& out,
                     const std::string& prefix = {});
/// Maps that were begun after a loss and have stayed beside.
[[nodiscard]] std::string separate_report(const runtime::RunSummary& summary);
/// What gave the a-priori masks, and whether it marked anything.
[[nodiscard]] std::string mask_report(const runtime::RunOptions& options, const runtime::RunSummary& summary);
/// What the map may show that is not of the static scene: only a network or masks know people who keep still.
[[nodiscard]] std::string map_report(const runtime::RunOptions& options, const runtime::RunSummary& summary);
/// What a live run dropped, and how late the rest was.
[[nodiscard]] std::string live_report(const runtime::RunSummary& summary);

}  // namespace dynslam::app
