// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <array>
#include <cstddef>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "dynslam/eval/trajectory.hpp"
#include "dynslam/runtime/io/mask_reader.hpp"
#include "dynslam/runtime/io/sequence.hpp"

namespace dynslam::runtime {

/// How an estimate is compared.
struct EvaluationOptions {
  EvaluationOptions() = default;
  /// Options of the sequence alone are options, too.
  EvaluationOptions(SequenceOptions sequence) : reading(std::move(sequence)) {}  // NOLINT
  SequenceOptions reading;  ///< of the ground truth's sequence
  Alignment alignment = Alignment::se3;
  std::optional<double> offset;  ///< added to the estimate's times [s]
  bool find_offset = false;      ///< find it, whatever the clocks say
  std::filesystem::path
      body_pose;  ///< the camera's pose on the body that the ground truth is of; empty: none
};

/// se3, sim3, none or first; nullopt for other words.
[[nodiscard]] std::optional<Alignment> parse_alignment(std::string_view name);
/// The same word.
[[nodiscard]] std::string_view to_string(Alignment alignment);

/// Results of the `eval` command. What cannot be given has no pairs and statistics that are NaN, and a note.
struct TrajectoryReport {
  AteResult<double> ate;
  RpeResult<double> rpe;
  double end_error = 0;              ///< of the motion from the first to the last pose [m]; NaN: not given
  std::vector<std::string> notes{};  ///< what is not given and why, what was left out or changed, a line each
};

/// ATE and RPE over 1 s of an estimate. `est_name` and `gt_name` are for messages.
/// @throws InputError where neither can be given, with the reason and both ranges of time
[[nodiscard]] TrajectoryReport evaluate_trajectory(std::span<const StampedPose<double>> estimate,
                                                   std::span<const StampedPose<double>> groundtruth,
                                                   const std::string& est_name, const std::string& gt_name,
                                                   const EvaluationOptions& options = {});
/// The same of files in TUM format, or of folders: `estimate` may be the folder of a run, `groundtruth` that
/// of a sequence, or a bag, whose format says where its poses are and what they mean. Rows that are no pose
/// are left out.
[[nodiscard]] TrajectoryReport evaluate_trajectory(const std::filesystem::path& estimate,
                                                   const std::filesystem::path& groundtruth,
                                                   const EvaluationOptions& options = {});
/// {"pairs": n, "ate_m": S, "rpe_trans_m": S, "rpe_rot_deg": S}, S = {"rmse", "mean", "median", "std", "min",
/// "max"}
[[nodiscard]] nlohmann::json to_json(const TrajectoryReport& report);
/// As `eval` prints it.
[[nodiscard]] std::string to_text(const TrajectoryReport& report);

/// Figures of both trajectories of a run.
struct RunReport {
  TrajectoryReport trajectory;           ///< in the end: trajectory.txt
  std::optional<TrajectoryReport> live;  ///< as the frames came: trajectory_live.txt
  std::string no_live;                   ///< why there is none, then
};

/// Both trajectories of a run, with the names of their files for error messages.
/// @throws InputError as above for the one in the end; that the other cannot be compared is part of the
/// result
[[nodiscard]] RunReport evaluate_run(std::span<const StampedPose<double>> trajectory,
                                     std::span<const StampedPose<double>> live,
                                     std::span<const StampedPose<double>> groundtruth,
                                     const std::filesystem::path& folder, const std::string& gt_name,
                                     const EvaluationOptions& options = {});
/// The same of a run's folder, with `groundtruth` as above. A run of an earlier version has one trajectory.
[[nodiscard]] RunReport evaluate_run(const std::filesystem::path& folder,
                                     const std::filesystem::path& groundtruth,
                                     const EvaluationOptions& options = {});
/// That of the trajectory in the end, and "live": the same of the other one; null: there is none.
[[nodiscard]] nlohmann::json to_json(const RunReport& report);
/// As `eval` prints it of a run's folder.
[[nodiscard]] std::string to_text(const RunReport& report);

/// Share of a frame's pixels over a sequence's frames.
struct MaskShares {
  std::size_t frames = 0;
  double mean = 0, p95 = 0, worst = 0;
  std::string read_as{};  ///< how the files were read, in a line
};

/// What the `eval-masks` command prints; pixels summed over all frames.
struct MaskReport {
  std::size_t frames = 0;
  std::size_t missing = 0;  ///< truth frames without a prediction, counted as empty predictions
  double iou = 0, recall = 0, precision = 0;
  std::size_t frames_recall_below_0_3 = 0;  ///< among the frames whose truth has any pixel
  /// Of predicted pixels farther than `widen` pixels from any true one: masks on what does not move.
  MaskShares spill;
  std::array<std::string, 2> read_as{};  ///< how the predicted and the true files were read, a line each
};

/// Compares predicted masks with the truth, PNG files of equal names, each folder read by one rule as
/// MaskSource does.
/// @param options, truth_options  how the predicted and the true ones are read
/// @param widen  by how much the truth is widened before what lies beyond it is spill [px]: rims are
/// uncertain
/// @throws InputError  missing folders, unreadable images, sizes that differ, no file in common
[[nodiscard]] MaskReport evaluate_masks(const std::filesystem::path& predicted,
                                        const std::filesystem::path& truth, int widen = 0,
                                        const MaskOptions& options = {},
                                        const MaskOptions& truth_options = {});
/// As `eval-masks --json` prints it.
[[nodiscard]] nlohmann::json to_json(const MaskReport& report);
/// As `eval-masks` prints it.
[[nodiscard]] std::string to_text(const MaskReport& report);

/// Share of pixels that masks cover, per frame: where nothing moves, false alarms.
/// @throws InputError  a missing folder, one without masks, unreadable images
[[nodiscard]] MaskShares mask_shares(const std::filesystem::path& folder, const MaskOptions& options = {});
/// As `eval-masks --json` prints it without a truth.
[[nodiscard]] nlohmann::json to_json(const MaskShares& shares);
/// As `eval-masks` prints it without a truth.
[[nodiscard]] std::string to_text(const MaskShares& shares);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
