// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <istream>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "dynslam/eval/trajectory.hpp"
#include "dynslam/runtime/run/run_sequence.hpp"
#include "report/evidence.hpp"

namespace dynslam::runtime {

/// timings.csv.
struct RunTable {
  std::vector<std::string> columns;  ///< behind the stamp
  std::vector<std::string> stamps;
  std::vector<std::vector<double>> rows;  ///< NaN where a cell is empty
};

/// What `run` left in a folder.
struct RunFolder {
  std::filesystem::path folder;
  std::string name;
  nlohmann::json summary;
  std::string config;  ///< the text of config.toml
  RunOptions options;  ///< by that; `sequence` is where it lay
  std::vector<StampedPose<double>> trajectory, keyframes;
  RunTable times;
  std::optional<Evidence> evidence;  ///< where it ran with --report
  [[nodiscard]] bool has_map() const;
};

/// Reads timings.csv. @throws InputError with the line
[[nodiscard]] RunTable parse_times(std::istream& in, const std::string& name);

/// @throws InputError naming the file: a folder that holds no finished run, damaged files
[[nodiscard]] RunFolder read_run_folder(const std::filesystem::path& folder);

/// The folders of an ablation's modes, in its order; of another folder itself. @throws InputError
[[nodiscard]] std::vector<std::filesystem::path> folders_of_runs(const std::filesystem::path& folder);

}  // namespace dynslam::runtime
