// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/CLI.hpp>
#include <memory>

namespace dynslam::app {

/// `dynslam convert`: a sequence of any format as a folder of TUM's layout, scaled and thinned on request.
class ConvertCommand {
 public:
  explicit ConvertCommand(CLI::App& app);
  ~ConvertCommand();
  [[nodiscard]] bool chosen() const;
  /// @return exit code @throws InputError, UsageError
  [[nodiscard]] int run() const;

 private:
  struct Options;
  std::unique_ptr<Options> o_;
};

}  // namespace dynslam::app
