// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace dynslam::app {

/// The manual page in section 1 of the program, or of one of its commands (`dynslam-run`), in roff: what --help says.
[[nodiscard]] std::string manual_page(const CLI::App& app, const CLI::App* command);

/// What completes the program's commands, options and their values in a shell.
/// @param shell  bash, zsh or fish
[[nodiscard]] std::string completion_script(const CLI::App& app, const std::string& shell);

}  // namespace dynslam::app
