// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <vector>

#include "dynslam/runtime/io/map_io.hpp"

namespace dynslam::app {

/// load_map(), with a warning where its file cannot be checked.
[[nodiscard]] std::unique_ptr<interop::SemanticOcTree> load_checked_map(const std::filesystem::path& map);

/// A warning that names files made of a map where it has no occupied voxel.
void warn_if_empty(const interop::SemanticOcTree& tree, const std::filesystem::path& map,
                   const std::vector<std::filesystem::path>& made);

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
