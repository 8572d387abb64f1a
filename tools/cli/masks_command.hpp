// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/CLI.hpp>
#include <memory>

namespace dynslam::app {

/// `dynslam masks`: what moves, and nothing else, for other systems.
class MasksCommand {
 public:
  explicit MasksCommand(CLI::App& app);
  ~MasksCommand();
  [[nodiscard]] bool chosen() const;
  /// @return exit code @throws InputError, UsageError
  [[nodiscard]] int run() const;

 private:
  struct Options;
  std::unique_ptr<Options> o_;
};

}  // namespace dynslam::app
