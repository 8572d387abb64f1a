// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace dynslam::app {

/// --format, --topics and --rate, of every command that opens a sequence.
void add_format_options(CLI::App& app, std::string& format, std::string& topics, double& rate);

/// --camera, of every command that uses the camera of a sequence.
void add_camera_option(CLI::App& app, std::string& camera);

}  // namespace dynslam::app
