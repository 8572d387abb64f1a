// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <vector>

namespace dynslam::app {

/// Writes the report of runs and says where it is and what it leaves out. @throws what write_report() throws
void print_report(const std::vector<std::filesystem::path>& runs, const std::filesystem::path& out);

/// `dynslam report`: a page about runs that are there.
class ReportCommand {
 public:
  explicit ReportCommand(CLI::App& app);
  ~ReportCommand();
  [[nodiscard]] bool chosen() const;
  /// @return exit code @throws InputError, UsageError
  [[nodiscard]] int run() const;

 private:
  struct Options;
  std::unique_ptr<Options> o_;
};

}  // namespace dynslam::app
