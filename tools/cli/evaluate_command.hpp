// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/CLI.hpp>
#include <memory>

namespace dynslam::app {

/// `dynslam eval` and `dynslam eval-masks`: results against the truth; `dynslam mask-faults`: masks against
/// it.
class EvaluateCommand {
 public:
  explicit EvaluateCommand(CLI::App& app);
  ~EvaluateCommand();
  [[nodiscard]] bool chosen() const;
  /// @return exit code @throws InputError, UsageError
  [[nodiscard]] int run() const;

 private:
  struct Options;
  static void add_mask_options(CLI::App& app, Options& o);

  std::unique_ptr<Options> o_;
};

}  // namespace dynslam::app
