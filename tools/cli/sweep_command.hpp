// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/CLI.hpp>
#include <memory>

namespace dynslam::app {

/// `sweep`: sequences x variants x modes x seeds, run here or as jobs of others, and gathered into tables.
class SweepCommand {
 public:
  explicit SweepCommand(CLI::App& app);
  ~SweepCommand();
  SweepCommand(const SweepCommand&) = delete;
  SweepCommand& operator=(const SweepCommand&) = delete;

  [[nodiscard]] bool chosen() const;
  [[nodiscard]] int run() const;

 private:
  struct Options;
  std::unique_ptr<Options> o_;
};

}  // namespace dynslam::app
