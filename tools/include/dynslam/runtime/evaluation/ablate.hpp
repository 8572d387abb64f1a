// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <array>
#include <atomic>
#include <filesystem>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "dynslam/runtime/evaluation/evaluate.hpp"
#include "dynslam/runtime/evaluation/report.hpp"
#include "dynslam/runtime/run/run_sequence.hpp"

namespace dynslam::runtime {

/// One row of the ablation.
struct AblationRow {
  DynamicsMode mode = DynamicsMode::none;
  RunSummary run;
  std::optional<TrajectoryReport>
      trajectory;                   ///< empty where the run cannot be compared with the ground truth
  std::string not_comparable;       ///< why, then
  std::optional<MaskReport> masks;  ///< where the sequence has dynamic_mask/ and was run in full
};

/// In this order, each into a folder of its name.
inline constexpr std::array kAblationModes{DynamicsMode::none, DynamicsMode::semantic,
                                           DynamicsMode::geometric, DynamicsMode::both};

/// All modes on one sequence.
struct Ablation {
  std::string sequence;
  MotionMethod method = MotionMethod::full;
  std::vector<AblationRow> rows;  ///< in the order of kAblationModes
  bool semantic_skipped = false;  ///< no a-priori masks: only none and geometric were run
  bool interrupted = false;       ///< `rows` holds the modes that were finished before
};

/// What all modes of an ablation take beside their masks, so that they differ by these alone: with `paper`
/// nothing, as in `run`; with `full` all that `run` gives to any of them, the baseline included.
[[nodiscard]] constexpr Additions ablation_additions(MotionMethod method) {
  return additions(method, DynamicsMode::both);
}

/// Runs a sequence in all four modes (the paper's Table 4), which differ by their masks alone, into
/// `out/<mode>/` and writes tables.txt, tables.md, ablation.json, `trajectory_<mode>.png` (Fig. 5),
/// overlays.png (Fig. 3), `<mode>/overlays/<stamp>.png`, ate_over_time.png, map.png and map_height.png.
/// `options.tracker.method` says which segmentation and tracking; what the modes have in common is
/// ablation_additions(), unless the options say it.
/// A-priori masks come from `options.masks` or from the sequence's own label/ folder.
/// @throws InputError  like run_sequence, and without ground truth
[[nodiscard]] Ablation ablate(const RunOptions& options, const std::atomic<bool>& stop,
                              const std::function<void(DynamicsMode, const Progress&)>& progress = {});

/// The paper's tables: ATE and RPE (RMSE, mean, median, S.D.) per mode with the improvement over `none`
/// (Eq 13), then coverage (share of the frames that have a pose), speed and masks.
[[nodiscard]] std::vector<Table> tables(const Ablation& ablation);
/// The tables and what has to be said about them, for a terminal.
[[nodiscard]] std::string to_text(const Ablation& ablation);
/// The same as tables.md has it.
[[nodiscard]] std::string to_markdown(const Ablation& ablation);
/// The same as ablation.json has it.
[[nodiscard]] nlohmann::json to_json(const Ablation& ablation);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
