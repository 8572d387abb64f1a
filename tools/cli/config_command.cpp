// SPDX-License-Identifier: BSD-3-Clause
#include "config_command.hpp"

#include <iostream>

namespace dynslam::app {

ConfigCommand::ConfigCommand(CLI::App& app, const RunCommand& run)
    : run_(run),
      command_(app.add_subcommand("config",
                                  "Print every field of the configuration: default, unit, meaning, range")) {
  command_->add_option("file", file_, "Check this file, and print the configuration of a run with it");
}

int ConfigCommand::run() const {
  run_.finish_options();
  std::cout << runtime::config_file(run_.fields());
  return 0;
}

}  // namespace dynslam::app
