// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/CLI.hpp>
#include <memory>

#include "dynslam/runtime/config/options_file.hpp"

namespace dynslam::app {

/// `dynslam run`: tracks a sequence.
class RunCommand {
 public:
  explicit RunCommand(CLI::App& app);
  ~RunCommand();
  [[nodiscard]] bool chosen() const;
  /// What a configuration file can set.
  [[nodiscard]] runtime::ConfigFields fields() const;
  /// The options of `config`: those of a run without command line.
  void finish_options() const;
  /// What a run would refuse before its first frame. @throws UsageError, InputError
  void check() const;
  /// @return exit code @throws InputError, UsageError
  [[nodiscard]] int run() const;

 private:
  struct Options;
  std::unique_ptr<Options> o_;
};

/// `dynslam ablate`: runs a sequence in all modes.
class AblateCommand {
 public:
  explicit AblateCommand(CLI::App& app);
  ~AblateCommand();
  [[nodiscard]] bool chosen() const;
  /// What a configuration file can set; a mode is not taken, as all are run.
  [[nodiscard]] runtime::ConfigFields fields() const;
  /// @return exit code @throws InputError, UsageError
  [[nodiscard]] int run() const;

 private:
  struct Options;
  std::unique_ptr<Options> o_;
};

}  // namespace dynslam::app
