// SPDX-License-Identifier: BSD-3-Clause
#include "config_command.hpp"

#include <iostream>

namespace dynslam::app {

ConfigCommand::ConfigCommand(CLI::App& app, const RunCommand& run)
    : run_(run),
      command_(app.add_subcommand("config",
                                  "Print the configuration of a run: fields with unit, meaning, range")) {
  command_->add_option("file", file_, "Check this file, and print the configuration of a run with it");
  command_->add_flag("--tuning", tuning_,
                     "Print all thresholds instead, for experiments: no version promises to keep them");
}

int ConfigCommand::run() const {
  run_.finish_options();
  std::cout << (tuning_ ? runtime::tuning_file(run_.fields()) : runtime::config_file(run_.fields()));
  return 0;
}

}  // namespace dynslam::app
