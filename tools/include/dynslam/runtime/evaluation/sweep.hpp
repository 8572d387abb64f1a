// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "dynslam/runtime/evaluation/evaluate.hpp"
#include "dynslam/runtime/evaluation/report.hpp"

namespace dynslam::runtime {

/// A run of a sweep.
struct SweepJob {
  std::string name;  ///< of its folder: SEQUENCE/VARIANT/MODE/seed-N; what there is one of without a level
  std::string sequence, variant, mode;  ///< variant: empty where the sweep has none
  std::string path;                     ///< of the sequence
  std::optional<std::size_t> seed;
  std::vector<std::string> arguments;  ///< of `dynslam run`, without --out
};

/// Sequences x variants x modes x seeds, as a file has them.
struct Sweep {
  std::string name;                                     ///< of the file, without its extension
  std::filesystem::path folder;                         ///< of the file: relative paths in it begin there
  std::string text;                                     ///< the file
  std::string out;                                      ///< its `out`; empty: it has none
  std::vector<std::string> sequences, variants, modes;  ///< by name, in the file's order
  std::vector<SweepJob> jobs;
};

/// Reads a sweep: `sequences`, `modes`, `seeds` (lists on one line), `out`, options of `run` under [options],
/// and under [variants.NAME] what a variant has beside them.
/// @throws InputError (file, line): what cannot be read, is unknown, missing or given twice
[[nodiscard]] Sweep read_sweep(const std::filesystem::path& file);

/// What was made of a job.
struct SweepRun {
  bool done = false;                           ///< with the job's options and by this program
  std::string failure;                         ///< why not, or why there is no accuracy; empty: there is one
  std::optional<TrajectoryReport> trajectory;  ///< in the end
  std::optional<TrajectoryReport> live;        ///< as the frames came, see RunReport
  std::size_t frames = 0, tracked = 0;
};

/// What job.json in a job's folder says of it: the job with its options and configuration file, and the
/// program that ran it.
[[nodiscard]] nlohmann::json sweep_record(const SweepJob& job, const std::string& program, int exit_code);

/// Whether the job was run to its end with these options by this program. @param program  version and commit
[[nodiscard]] bool is_done(const SweepJob& job, const std::filesystem::path& out, const std::string& program);

/// Compares what is in the folders with the sequences' ground truth, job by job.
[[nodiscard]] std::vector<SweepRun> gather_sweep(const Sweep& sweep, const std::filesystem::path& out,
                                                 const std::string& program);

/// ATE and RPE (RMSE, mean, median, S.D.) as mean and spread (sample standard deviation) over the seeds, the
/// worst seed's RMSE and the improvement over `none` (Eq 13), ATE by mode, the median and the worst seed's
/// ATE in the end and as the frames came, and coverage.
[[nodiscard]] std::vector<Table> tables(const Sweep& sweep, const std::vector<SweepRun>& runs);
/// The tables with the program and the configuration.
[[nodiscard]] std::string to_markdown(const Sweep& sweep, const std::vector<SweepRun>& runs,
                                      const std::string& program);
/// The same as tabulars for a paper; needs no package.
[[nodiscard]] std::string to_latex(const Sweep& sweep, const std::vector<SweepRun>& runs,
                                   const std::string& program);
/// The same with every run.
[[nodiscard]] nlohmann::json to_json(const Sweep& sweep, const std::vector<SweepRun>& runs,
                                     const std::string& program);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
