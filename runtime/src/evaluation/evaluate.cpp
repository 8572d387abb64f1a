// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/evaluation/evaluate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <numeric>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"

namespace dynslam::runtime {
namespace {

namespace fs = std::filesystem;

nlohmann::json to_json(const Statistics<double>& s) {
  return {{"rmse", s.rmse}, {"mean", s.mean}, {"median", s.median},
          {"std", s.std},   {"min", s.min},   {"max", s.max}};
}

std::string row(std::string_view name, const Statistics<double>& s) {
  return fmt::format("{:<22} {:>9.6f} {:>9.6f} {:>9.6f} {:>9.6f} {:>9.6f} {:>9.6f}\n", name, s.rmse, s.mean,
                     s.median, s.std, s.min, s.max);
}

/// @param shares  of one frame at least
MaskShares shares_of(std::vector<double> shares) {
  std::sort(shares.begin(), shares.end());
  const auto n = static_cast<double>(shares.size());
  return {shares.size(), std::accumulate(shares.begin(), shares.end(), 0.0) / n,
          shares[static_cast<std::size_t>(0.95 * (n - 1) + 0.5)], shares.back()};
}

/// Names of the PNG files in a folder, sorted. @throws InputError where there are none
std::vector<fs::path> mask_names(const fs::path& folder) {
  if (!fs::is_directory(folder)) throw InputError(folder.string(), 0, "is not a folder");
  std::vector<fs::path> names;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() == ".png") names.push_back(entry.path().filename());
  }
  std::sort(names.begin(), names.end());
  if (names.empty()) throw InputError(folder.string(), 0, "holds no PNG masks");
  return names;
}

constexpr const char* kFinal = "trajectory.txt";
constexpr const char* kLive = "trajectory_live.txt";

/// Poses to compare with, and the file that they are of.
struct Truth {
  std::vector<StampedPose<double>> poses;
  std::string name;
};

/// @param groundtruth  a file in TUM format, the folder of a sequence, or a bag
Truth read_truth(const fs::path& groundtruth, const SequenceOptions& options) {
  const bool sequence_file =
      options.format == "bag" || options.format == "ros2" || !formats_of(groundtruth).empty();
  if (!fs::is_directory(groundtruth) && !sequence_file)
    return {read_trajectory(groundtruth), groundtruth.string()};
  Sequence sequence = load_sequence(groundtruth, options);
  if (sequence.groundtruth.empty())
    throw InputError(groundtruth.string(), 0,
                     sequence.truth_missing.empty()
                         ? fmt::format("has no ground truth; its format is {}", sequence.format)
                         : "has no ground truth: " + sequence.truth_missing);
  return {std::move(sequence.groundtruth), sequence.truth_file.string()};
}

double ratio(std::size_t a, std::size_t b) {
  return b > 0 ? static_cast<double>(a) / static_cast<double>(b) : 0.0;
}

}  // namespace

TrajectoryReport evaluate_trajectory(std::span<const StampedPose<double>> estimate,
                                     std::span<const StampedPose<double>> groundtruth,
                                     const std::string& est_name, const std::string& gt_name) {
  const auto ate = absolute_trajectory_error<double>(estimate, groundtruth);
  if (!ate) {
    throw InputError(gt_name, 0,
                     fmt::format("cannot be aligned with {}: fewer than 3 poses within 0.02 s, or positions "
                                 "on one line or in one place",
                                 est_name));
  }
  const auto rpe = relative_pose_error<double>(estimate, groundtruth);
  if (!rpe)
    throw InputError(est_name, 0,
                     fmt::format("has fewer than 2 intervals of 1 s with ground truth in {}", gt_name));
  return {*ate, *rpe, end_error<double>(estimate, groundtruth).value_or(0.0)};
}

TrajectoryReport evaluate_trajectory(const fs::path& estimate, const fs::path& groundtruth) {
  return evaluate_trajectory(estimate, groundtruth, SequenceOptions{});
}

TrajectoryReport evaluate_trajectory(const fs::path& estimate, const fs::path& groundtruth,
                                     const SequenceOptions& options) {
  const fs::path file = fs::is_directory(estimate) ? estimate / kFinal : estimate;
  const auto est = read_trajectory(file);
  const Truth truth = read_truth(groundtruth, options);
  return evaluate_trajectory(est, truth.poses, file.string(), truth.name);
}

nlohmann::json to_json(const TrajectoryReport& report) {
  return {{"pairs", report.ate.pairs},
          {"ate_m", to_json(report.ate.translation)},
          {"rpe_trans_m", to_json(report.rpe.translation)},
          {"rpe_rot_deg", to_json(report.rpe.rotation_deg)},
          {"end_error_m", report.end_error}};
}

std::string to_text(const TrajectoryReport& report) {
  return fmt::format("{} pairs{:>{}} {:>9} {:>9} {:>9} {:>9} {:>9}\n", report.ate.pairs, "RMSE",
                     32 - 6 - static_cast<int>(std::to_string(report.ate.pairs).size()), "mean", "median",
                     "S.D.", "min", "max") +
         row("ATE [m]", report.ate.translation) + row("RPE translation [m/s]", report.rpe.translation) +
         row("RPE rotation [deg/s]", report.rpe.rotation_deg) +
         fmt::format("{:<22} {:>9.6f}\n", "first to last [m]", report.end_error);
}

RunReport evaluate_run(std::span<const StampedPose<double>> trajectory,
                       std::span<const StampedPose<double>> live,
                       std::span<const StampedPose<double>> groundtruth, const fs::path& folder,
                       const std::string& gt_name) {
  RunReport report;
  report.trajectory = evaluate_trajectory(trajectory, groundtruth, (folder / kFinal).string(), gt_name);
  try {
    report.live = evaluate_trajectory(live, groundtruth, (folder / kLive).string(), gt_name);
  } catch (const InputError& error) {
    report.no_live = error.what();
  }
  return report;
}

RunReport evaluate_run(const fs::path& folder, const fs::path& groundtruth, const SequenceOptions& options) {
  const auto trajectory = read_trajectory(folder / kFinal);
  const Truth truth = read_truth(groundtruth, options);
  if (fs::exists(folder / kLive))
    return evaluate_run(trajectory, read_trajectory(folder / kLive), truth.poses, folder, truth.name);
  RunReport report;
  report.trajectory = evaluate_trajectory(trajectory, truth.poses, (folder / kFinal).string(), truth.name);
  report.no_live = fmt::format("{} is missing, as in runs of earlier versions", (folder / kLive).string());
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

MaskReport evaluate_masks(const fs::path& predicted, const fs::path& truth, int widen) {
  if (!fs::is_directory(predicted)) throw InputError(predicted.string(), 0, "is not a folder");
  const std::vector<fs::path> names = mask_names(truth);
  MaskReport report;
  std::size_t both = 0, either = 0, in_truth = 0, in_prediction = 0;
  std::vector<double> spill;
  const cv::Mat around = cv::getStructuringElement(cv::MORPH_ELLIPSE, cv::Size(2 * widen + 1, 2 * widen + 1));
  for (const fs::path& name : names) {
    const cv::Mat expected = read_image(truth / name, cv::IMREAD_GRAYSCALE) != 0;
    cv::Mat found = cv::Mat::zeros(expected.size(), CV_8UC1);
    if (fs::exists(predicted / name)) {
      found = read_image(predicted / name, cv::IMREAD_GRAYSCALE) != 0;
      if (found.size() != expected.size())
        throw InputError((predicted / name).string(), 0, "and its truth differ in size");
    } else {
      ++report.missing;
    }
    const auto common = static_cast<std::size_t>(cv::countNonZero(found & expected));
    const auto wanted = static_cast<std::size_t>(cv::countNonZero(expected));
    both += common;
    in_truth += wanted;
    in_prediction += static_cast<std::size_t>(cv::countNonZero(found));
    either += static_cast<std::size_t>(cv::countNonZero(found | expected));
    if (wanted > 0 && ratio(common, wanted) < 0.3) ++report.frames_recall_below_0_3;
    cv::Mat near = expected;
    if (widen > 0) cv::dilate(expected, near, around);
    spill.push_back(ratio(static_cast<std::size_t>(cv::countNonZero(found & ~near)), expected.total()));
    ++report.frames;
  }
  if (report.missing == report.frames)
    throw InputError(predicted.string(), 0, "has no mask in common with " + truth.string());
  report.iou = ratio(both, either);
  report.recall = ratio(both, in_truth);
  report.precision = ratio(both, in_prediction);
  report.spill = shares_of(std::move(spill));
  return report;
}

nlohmann::json to_json(const MaskReport& r) {
  return {{"frames", r.frames},
          {"missing", r.missing},
          {"iou", r.iou},
          {"recall", r.recall},
          {"precision", r.precision},
          {"frames_recall_below_0_3", r.frames_recall_below_0_3},
          {"spill", to_json(r.spill)}};
}

std::string to_text(const MaskReport& r) {
  return fmt::format(
      "{} frames ({} without a prediction): recall {:.4f}, IoU {:.4f}, precision {:.4f}, {} frames with "
      "recall below 0.3; beyond the truth {:.2f} % of a frame's pixels, worst {:.2f} %\n",
      r.frames, r.missing, r.recall, r.iou, r.precision, r.frames_recall_below_0_3, 100 * r.spill.mean,
      100 * r.spill.worst);
}

MaskShares mask_shares(const fs::path& folder) {
  std::vector<double> shares;
  for (const fs::path& name : mask_names(folder)) {
    const cv::Mat mask = read_image(folder / name, cv::IMREAD_GRAYSCALE);
    shares.push_back(ratio(static_cast<std::size_t>(cv::countNonZero(mask)), mask.total()));
  }
  return shares_of(std::move(shares));
}

nlohmann::json to_json(const MaskShares& s) {
  return {{"frames", s.frames}, {"mean", s.mean}, {"p95", s.p95}, {"worst", s.worst}};
}

std::string to_text(const MaskShares& s) {
  return fmt::format("{} frames: masks cover {:.2f} % of a frame's pixels, p95 {:.2f} %, worst {:.2f} %\n",
                     s.frames, 100 * s.mean, 100 * s.p95, 100 * s.worst);
}

}  // namespace dynslam::runtime
