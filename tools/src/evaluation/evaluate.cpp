// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/evaluation/evaluate.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"
#include "evaluation/body_pose.hpp"
#include "evaluation/clock_offset.hpp"

namespace dynslam::runtime {
namespace {

namespace fs = std::filesystem;
using Trajectory = std::span<const StampedPose<double>>;

constexpr double kNear = 0.02, kInterval = 1.0;  // seconds
constexpr std::array<std::pair<Alignment, std::string_view>, 4> kAlignments{{{Alignment::se3, "se3"},
                                                                             {Alignment::sim3, "sim3"},
                                                                             {Alignment::none, "none"},
                                                                             {Alignment::first, "first"}}};

nlohmann::json to_json(const Statistics<double>& s) {
  return {{"rmse", s.rmse}, {"mean", s.mean}, {"median", s.median},  // NaN becomes null
          {"std", s.std},   {"min", s.min},   {"max", s.max}};
}

std::string row(std::string_view name, const Statistics<double>& s) {
  return fmt::format("{:<22} {:>9.6f} {:>9.6f} {:>9.6f} {:>9.6f} {:>9.6f} {:>9.6f}\n", name, s.rmse, s.mean,
                     s.median, s.std, s.min, s.max);
}

Statistics<double> not_given() {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  return {kNone, kNone, kNone, kNone, kNone, kNone};
}

constexpr const char* kFinal = "trajectory.txt";
constexpr const char* kLive = "trajectory_live.txt";

/// Poses of a file or sequence, what they are called, and what is to be said of them.
struct NamedPoses {
  std::vector<StampedPose<double>> poses;
  std::string name;
  std::vector<std::string> notes{};
};

NamedPoses read_poses(const fs::path& file) {
  UsablePoses found = read_usable_poses(file);
  NamedPoses result{std::move(found.poses), file.string()};
  if (found.left_out > 0) result.notes.push_back(found.note());
  return result;
}

/// @param groundtruth  a file in TUM format, the folder of a sequence, or a bag
NamedPoses truth_as_published(const fs::path& groundtruth, const SequenceOptions& options) {
  const bool sequence_file =
      options.format == "bag" || options.format == "ros2" || !formats_of(groundtruth).empty();
  if (!fs::is_directory(groundtruth) && !sequence_file) {
    NamedPoses truth = read_poses(groundtruth);
    turn_bonn_file(groundtruth, truth.poses, truth.notes);
    return truth;
  }
  Sequence sequence = load_sequence(groundtruth, options);
  if (sequence.groundtruth.empty())
    throw InputError(groundtruth.string(), 0,
                     sequence.truth_missing.empty()
                         ? fmt::format("has no ground truth; its format is {}", sequence.format)
                         : "has no ground truth: " + sequence.truth_missing);
  NamedPoses truth{std::move(sequence.groundtruth), sequence.truth_file.string(), std::move(sequence.notes)};
  if (!sequence.truth_turned.empty()) truth.notes.push_back(sequence.truth_turned);
  return truth;
}

NamedPoses read_truth(const fs::path& groundtruth, const EvaluationOptions& options) {
  NamedPoses truth = truth_as_published(groundtruth, options.reading);
  if (!options.body_pose.empty()) apply_body_pose(read_body_pose(options.body_pose), truth.poses);
  return truth;
}

/// "from 1.000 to 2.000 s"
std::string range(Trajectory poses) {
  return poses.empty() ? "empty" : fmt::format("from {:.3f} to {:.3f} s", poses.front().t, poses.back().t);
}

std::string both_ranges(Trajectory estimate, Trajectory groundtruth, const std::string& est_name,
                        const std::string& gt_name) {
  return fmt::format("{} is {}, {} {}", est_name, range(estimate), gt_name, range(groundtruth));
}

std::vector<double> times_of_poses(Trajectory poses) {
  std::vector<double> times;
  for (const auto& pose : poses) times.push_back(pose.t);
  return times;
}

/// How far positions spread: 0 in one place, 1 on a line, else 2.
int dimensions_of(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : points) mean += p / static_cast<double>(points.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& p : points) spread += (p - mean) * (p - mean).transpose();
  const Eigen::Vector3d values = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvalues();
  constexpr double kNothing = 1e-12, kThin = 1e-10;  // m^2; of the largest
  if (!(values(2) > kNothing)) return 0;
  return values(1) > kThin * values(2) ? 2 : 1;
}

/// Positions of the estimate and of the ground truth that belong together.
using PairedPoints = std::array<std::vector<Eigen::Vector3d>, 2>;
PairedPoints paired_points(Trajectory estimate, Trajectory groundtruth) {
  PairedPoints points;
  for (const auto& [i, j] : associate(times_of_poses(groundtruth), times_of_poses(estimate), kNear)) {
    points[0].push_back(estimate[j].T_w_c.translation());
    points[1].push_back(groundtruth[i].T_w_c.translation());
  }
  return points;
}

/// Whether one of the two is in one place, within a micrometre: a scale between them would be one of noise.
bool scale_is_open(Trajectory estimate, Trajectory groundtruth) {
  const PairedPoints points = paired_points(estimate, groundtruth);
  return dimensions_of(points[0]) == 0 || dimensions_of(points[1]) == 0;
}

/// Why an ATE cannot be given.
std::string why_no_ate(Trajectory estimate, Trajectory groundtruth, const std::string& est_name,
                       const std::string& gt_name, Alignment alignment) {
  const PairedPoints points = paired_points(estimate, groundtruth);
  const std::size_t pairs = points[0].size();
  const std::string ranges = both_ranges(estimate, groundtruth, est_name, gt_name);
  const bool any = alignment == Alignment::none || alignment == Alignment::first;
  if (pairs < (any ? 1U : 3U))
    return fmt::format("no ATE: {} of {} poses have one of the ground truth within {} s, {} are needed; {}",
                       pairs, estimate.size(), kNear, any ? 1 : 3, ranges);
  const int of_estimate = dimensions_of(points[0]), of_truth = dimensions_of(points[1]);
  const bool truth = of_truth < of_estimate;
  return fmt::format(
      "no ATE: the positions of {} {}, which leaves the {} between the two open "
      "(--align first or none compares without one); {}",
      truth ? gt_name : est_name,
      std::min(of_estimate, of_truth) == 0 ? "are all in one place" : "lie on one line",
      alignment == Alignment::sim3 ? "rotation or the scale" : "rotation", ranges);
}

std::string why_no_rpe(Trajectory estimate, Trajectory groundtruth, const std::string& est_name,
                       const std::string& gt_name) {
  return fmt::format("no RPE: fewer than 2 intervals of {} s have poses of both; {}", kInterval,
                     both_ranges(estimate, groundtruth, est_name, gt_name));
}

std::vector<StampedPose<double>> shifted(Trajectory poses, double offset) {
  std::vector<StampedPose<double>> result(poses.begin(), poses.end());
  for (auto& pose : result) pose = {pose.t + offset, pose.T_w_c};
  return result;
}

}  // namespace

std::optional<Alignment> parse_alignment(std::string_view name) {
  for (const auto& [alignment, its_name] : kAlignments) {
    if (name == its_name) return alignment;
  }
  return std::nullopt;
}

std::string_view to_string(Alignment alignment) {
  for (const auto& [one, name] : kAlignments) {
    if (one == alignment) return name;
  }
  return "unknown";
}

TrajectoryReport evaluate_trajectory(Trajectory given, Trajectory groundtruth, const std::string& est_name,
                                     const std::string& gt_name, const EvaluationOptions& options) {
  TrajectoryReport report;
  std::optional<double> offset = options.offset;
  if (options.find_offset) {
    const auto found = clock_offset(given, groundtruth);
    if (!found)
      throw InputError(est_name, 0,
                       "does not tell the offset of its clock to 0.02 s: it moves too little, too evenly or "
                       "otherwise than " +
                           gt_name);
    offset = found->seconds;
    report.notes.push_back(
        fmt::format("offset of the clocks: {:.4f} s (± {:.4f} s) added to the estimate's times",
                    found->seconds, found->deviation));
  }
  const std::vector<StampedPose<double>> moved = shifted(given, offset.value_or(0));
  const Trajectory estimate = offset ? Trajectory(moved) : given;
  auto ate = absolute_trajectory_error<double>(estimate, groundtruth, kNear, options.alignment);
  if (ate && options.alignment == Alignment::sim3 && scale_is_open(estimate, groundtruth)) ate.reset();
  const auto rpe = relative_pose_error<double>(estimate, groundtruth, kInterval);
  report.ate.translation = report.rpe.translation = report.rpe.rotation_deg = not_given();
  report.end_error = std::numeric_limits<double>::quiet_NaN();
  std::vector<std::string> missing;
  if (ate) {
    report.ate = *ate;
  } else {
    missing.push_back(why_no_ate(estimate, groundtruth, est_name, gt_name, options.alignment));
  }
  if (rpe) {
    report.rpe = *rpe;
  } else {
    missing.push_back(why_no_rpe(estimate, groundtruth, est_name, gt_name));
  }
  if (!ate && !rpe) throw InputError(gt_name, 0, missing.front());
  if (const auto error = end_error<double>(estimate, groundtruth)) report.end_error = *error;
  if (ate && options.alignment == Alignment::sim3)
    report.notes.push_back(fmt::format("scale: the estimate times {:.6f}", report.ate.scale));
  report.notes.insert(report.notes.end(), missing.begin(), missing.end());
  if (ate && rpe) note_turned_body(estimate, groundtruth, *ate, *rpe, report.notes);
  return report;
}

TrajectoryReport evaluate_trajectory(const fs::path& estimate, const fs::path& groundtruth,
                                     const EvaluationOptions& options) {
  const NamedPoses est = read_poses(fs::is_directory(estimate) ? estimate / kFinal : estimate);
  const NamedPoses truth = read_truth(groundtruth, options);
  TrajectoryReport report = evaluate_trajectory(est.poses, truth.poses, est.name, truth.name, options);
  for (const auto& notes : {est.notes, truth.notes})
    report.notes.insert(report.notes.end(), notes.begin(), notes.end());
  return report;
}

nlohmann::json to_json(const TrajectoryReport& report) {
  return {{"pairs", report.ate.pairs},
          {"ate_m", to_json(report.ate.translation)},
          {"rpe_trans_m", to_json(report.rpe.translation)},
          {"rpe_rot_deg", to_json(report.rpe.rotation_deg)},
          {"end_error_m", report.end_error},
          {"notes", report.notes}};
}

std::string to_text(const TrajectoryReport& report) {
  const bool ate = report.ate.pairs > 0, rpe = report.rpe.pairs > 0;
  std::string text = fmt::format("{} pairs{:>{}} {:>9} {:>9} {:>9} {:>9} {:>9}\n", report.ate.pairs, "RMSE",
                                 32 - 6 - static_cast<int>(std::to_string(report.ate.pairs).size()), "mean",
                                 "median", "S.D.", "min", "max");
  if (ate) text += row("ATE [m]", report.ate.translation);
  if (rpe)
    text += row("RPE translation [m/s]", report.rpe.translation) +
            row("RPE rotation [deg/s]", report.rpe.rotation_deg);
  if (std::isfinite(report.end_error))
    text += fmt::format("{:<22} {:>9.6f}\n", "first to last [m]", report.end_error);
  for (const std::string& note : report.notes) text += note + '\n';
  return text;
}

RunReport evaluate_run(Trajectory trajectory, Trajectory live, Trajectory groundtruth, const fs::path& folder,
                       const std::string& gt_name, const EvaluationOptions& options) {
  RunReport report;
  report.trajectory =
      evaluate_trajectory(trajectory, groundtruth, (folder / kFinal).string(), gt_name, options);
  try {
    report.live = evaluate_trajectory(live, groundtruth, (folder / kLive).string(), gt_name, options);
  } catch (const InputError& error) {
    report.no_live = error.what();
  }
  return report;
}

RunReport evaluate_run(const fs::path& folder, const fs::path& groundtruth,
                       const EvaluationOptions& options) {
  const NamedPoses est = read_poses(folder / kFinal);
  const NamedPoses truth = read_truth(groundtruth, options);
  RunReport report;
  if (fs::exists(folder / kLive)) {
    report =
        evaluate_run(est.poses, read_poses(folder / kLive).poses, truth.poses, folder, truth.name, options);
  } else {
    report.trajectory = evaluate_trajectory(est.poses, truth.poses, est.name, truth.name, options);
    report.no_live = fmt::format("{} is missing, as in runs of earlier versions", (folder / kLive).string());
  }
  for (const auto& notes : {est.notes, truth.notes})
    report.trajectory.notes.insert(report.trajectory.notes.end(), notes.begin(), notes.end());
  return report;
}

nlohmann::json to_json(const RunReport& report) {
  nlohmann::json j = to_json(report.trajectory);
  j["live"] = report.live ? to_json(*report.live) : nlohmann::json();
  return j;
}

std::string to_text(const RunReport& report) {
  return "In the end (trajectory.txt)\n" + to_text(report.trajectory) +
         (report.live ? "As the frames came (trajectory_live.txt)\n" + to_text(*report.live)
                      : fmt::format("no live trajectory: {}\n", report.no_live));
}

}  // namespace dynslam::runtime
