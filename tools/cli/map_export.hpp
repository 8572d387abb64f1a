// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>

namespace dynslam::app {

/// Refuses to write over the map that is read. @throws UsageError
void check_other_file(const std::filesystem::path& map, const std::filesystem::path& out);

/// `dynslam map export`: a saved map for other programs.
class MapExport {
 public:
  /// @param command  its own subcommand
  explicit MapExport(CLI::App& command);
  ~MapExport();
  /// Writes what was asked for of a map. @throws InputError, UsageError
  void run(const std::filesystem::path& map) const;

 private:
  struct Options;
  std::unique_ptr<Options> o_;
};

}  // namespace dynslam::app
