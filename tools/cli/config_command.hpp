// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "run_command.hpp"

namespace dynslam::app {

/// `dynslam config`: prints the configuration file of a run, or all tuning fields.
class ConfigCommand {
 public:
  /// @param run  whose options they are
  ConfigCommand(CLI::App& app, const RunCommand& run);
  [[nodiscard]] bool chosen() const { return command_->parsed(); }
  /// @return exit code
  [[nodiscard]] int run() const;

 private:
  const RunCommand& run_;
  CLI::App* command_;
  std::string file_;  // for --help: see arguments()
  bool tuning_ = false;
};

}  // namespace dynslam::app
