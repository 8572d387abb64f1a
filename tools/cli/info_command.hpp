// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/CLI.hpp>
#include <memory>

namespace dynslam::app {

/// `dynslam info`: what a sequence is, with warnings.
class InfoCommand {
 public:
  explicit InfoCommand(CLI::App& app);
  ~InfoCommand();
  [[nodiscard]] bool chosen() const;
  /// @return exit code: 0 also with warnings @throws InputError, UsageError
  [[nodiscard]] int run() const;

 private:
  struct Options;
  std::unique_ptr<Options> o_;
};

}  // namespace dynslam::app
