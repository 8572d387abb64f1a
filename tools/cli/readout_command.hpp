// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/CLI.hpp>
#include <memory>

namespace dynslam::app {

/// `dynslam readout`: how long a camera takes to read the rows of its images.
class ReadoutCommand {
 public:
  explicit ReadoutCommand(CLI::App& app);
  ~ReadoutCommand();
  [[nodiscard]] bool chosen() const;
  /// @return exit code: 1 where the sequence does not tell @throws InputError, UsageError
  [[nodiscard]] int run() const;

 private:
  struct Options;
  std::unique_ptr<Options> o_;
};

}  // namespace dynslam::app
