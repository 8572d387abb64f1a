// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace dynslam::app {

/// `dynslam man` and `dynslam completion`: what --help says, as manual pages and for shells.
class HelpCommands {
 public:
  explicit HelpCommands(CLI::App& app);
  [[nodiscard]] bool chosen() const { return man_->parsed() || completion_->parsed(); }
  /// @return exit code
  [[nodiscard]] int run() const;

 private:
  const CLI::App& app_;
  CLI::App *man_, *completion_;
  std::string shell_;
};

}  // namespace dynslam::app
