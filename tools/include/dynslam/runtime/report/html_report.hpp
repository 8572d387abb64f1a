// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace dynslam::runtime {

/// What write_report() shows, and where.
struct ReportOptions {
  /// Folders that `run` or `ablate` wrote; one of `ablate` stands for its modes. All of one sequence.
  std::vector<std::filesystem::path> runs;
  std::filesystem::path sequence;  ///< where it lies now; empty: where it lay at the run
  std::filesystem::path out;       ///< file to write; empty: report.html in the first of the folders
  std::filesystem::path page;      ///< page that the runs are put into; empty: report_page()
  /// Bytes that the file may have. More pictures, voxels and keypoints than fit are thinned, and the page
  /// says which; what is left cannot be thinned below a megabyte or two.
  std::size_t max_bytes = 15'000'000;
};

/// What write_report() wrote.
struct ReportResult {
  std::filesystem::path file;
  std::size_t bytes = 0;
  std::vector<std::string> thinned;  ///< what the page says about that, one line each
  std::vector<std::string> missing;  ///< what it lacks of runs without `--report`, a line for each of these
};

/// The page that is installed beside the program, or lies beside it in the build tree: HTML with all that it
/// needs, without a run. @throws UsageError where this program was built without it
[[nodiscard]] std::filesystem::path report_page();

/// Writes one HTML file about runs of a sequence that opens in a browser without network or server:
/// trajectories, errors, times, frames with masks and keypoints, keyframe graph, voxel map, configuration.
/// See docs/report.md.
/// @throws InputError: a folder that holds no run or one that was not finished, damaged files, runs of
/// several
///         sequences, a sequence that is not where it was, a file that cannot be written; UsageError of
///         report_page()
ReportResult write_report(const ReportOptions& options);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
