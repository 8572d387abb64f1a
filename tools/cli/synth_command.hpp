// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/CLI.hpp>
#include <memory>

namespace dynslam::app {

/// `dynslam synth`: makes a sequence of the synthetic office.
class SynthCommand {
 public:
  explicit SynthCommand(CLI::App& app);
  ~SynthCommand();
  [[nodiscard]] bool chosen() const;
  /// @return exit code @throws InputError, UsageError
  [[nodiscard]] int run() const;

 private:
  struct Options;
  std::unique_ptr<Options> o_;
};

}  // namespace dynslam::app
