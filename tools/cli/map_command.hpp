// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/CLI.hpp>
#include <memory>

namespace dynslam::app {

/// `dynslam map`: what a saved map holds, for people and for other programs.
class MapCommand {
 public:
  explicit MapCommand(CLI::App& app);
  ~MapCommand();
  [[nodiscard]] bool chosen() const;
  /// @return exit code @throws InputError, UsageError
  [[nodiscard]] int run() const;

 private:
  struct Options;
  std::unique_ptr<Options> o_;
};

}  // namespace dynslam::app
