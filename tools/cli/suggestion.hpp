// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace dynslam::app {

/// ", did you mean NAME?" for a command or for options that the chosen command does not have; empty where no
/// name is near. @param words  as they were typed
[[nodiscard]] std::string suggestion(const CLI::App& app, const std::vector<std::string>& words);

}  // namespace dynslam::app
