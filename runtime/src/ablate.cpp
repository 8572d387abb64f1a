// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/ablate.hpp"

#include <fmt/format.h>

#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <octomap/ColorOcTree.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/image_io.hpp"
#include "dynslam/runtime/map_render.hpp"
#include "dynslam/runtime/plot.hpp"
#include "dynslam/runtime/tum_reader.hpp"

namespace dynslam::runtime {
namespace {

namespace fs = std::filesystem;

std::string table(const Ablation& ablation, const std::string& title, const Statistics<double>& (*pick)(const AblationRow&)) {
  std::string text = fmt::format("{}\n{:<11}{:>9}{:>9}{:>9}{:>9}   {}\n", title, "", "RMSE", "mean", "median", "S.D.",
                                 "improvement of RMSE, mean, median, S.D. over none (Eq 13)");
  const Statistics<double>* base = nullptr;
  for (const AblationRow& row : ablation.rows) {
    const Statistics<double>& s = pick(row);
    text += fmt::format("{:<11}{:>9.4f}{:>9.4f}{:>9.4f}{:>9.4f}", to_string(row.mode), s.rmse, s.mean, s.median, s.std);
    if (row.mode == DynamicsMode::none) {
      base = &s;
    } else if (base != nullptr) {
      text += fmt::format("   {:>7.2f} % {:>7.2f} % {:>7.2f} % {:>7.2f} %", improvement_percent(base->rmse, s.rmse),
                          improvement_percent(base->mean, s.mean), improvement_percent(base->median, s.median), improvement_percent(base->std, s.std));
    }
    text += '\n';
  }
  return text;
}

const Statistics<double>& ate(const AblationRow& row) { return row.trajectory.ate.translation; }
const Statistics<double>& rpe_translation(const AblationRow& row) { return row.trajectory.rpe.translation; }
const Statistics<double>& rpe_rotation(const AblationRow& row) { return row.trajectory.rpe.rotation_deg; }

/// Rows: modes; columns: frames spread over the sequence.
cv::Mat overlays(const Ablation& ablation, const Sequence& sequence, const fs::path& out) {
  constexpr std::size_t kColumns = 5;
  cv::Mat sheet;
  for (const AblationRow& row : ablation.rows) {
    if (row.mode == DynamicsMode::none) continue;
    std::vector<cv::Mat> pictures;
    for (std::size_t k = 0; k < kColumns; ++k) {
      const FrameRecord& frame = sequence.frames[(2 * k + 1) * sequence.frames.size() / (2 * kColumns)];
      const fs::path mask = out / std::string(to_string(row.mode)) / "masks" / (frame.stamp + ".png");
      if (!fs::exists(mask)) continue;  // a broken or not reached frame
      cv::Mat picture = overlay_mask(read_image(frame.rgb, cv::IMREAD_COLOR), read_image(mask, cv::IMREAD_GRAYSCALE),
                                     fmt::format("{} {}", to_string(row.mode), frame.stamp));
      cv::resize(picture, picture, {}, 0.5, 0.5, cv::INTER_AREA);
      pictures.push_back(picture);
    }
    if (pictures.empty()) continue;
    while (pictures.size() < kColumns) pictures.push_back(cv::Mat::zeros(pictures.front().size(), CV_8UC3));
    cv::Mat strip;
    cv::hconcat(pictures, strip);
    sheet.push_back(strip);
  }
  return sheet;
}

void write_text(const fs::path& path, const std::string& text) {
  std::ofstream file(path);
  file << text;
  file.flush();
  if (!file) throw InputError(path.string(), 0, "cannot be written");
}

}  // namespace

Ablation ablate(const RunOptions& options, const std::atomic<bool>& stop,
                const std::function<void(DynamicsMode, const Progress&)>& progress) {
  SequenceOptions sequence_options;
  sequence_options.max_frames = options.max_frames;
  const Sequence sequence = load_sequence(options.sequence, sequence_options);
  if (sequence.groundtruth.empty()) throw InputError((options.sequence / "groundtruth.txt").string(), 0, "is missing: the ablation needs ground truth");
  RunOptions run = options;
  run.save_masks = true;
  if (run.masks.empty() && fs::is_directory(options.sequence / "label")) run.masks = options.sequence / "label";

  Ablation result;
  result.sequence = options.sequence.filename().empty() ? options.sequence.parent_path().filename().string() : options.sequence.filename().string();
  result.semantic_skipped = run.masks.empty();
  for (const auto mode : {DynamicsMode::none, DynamicsMode::semantic, DynamicsMode::geometric, DynamicsMode::both}) {
    if (stop.load()) break;
    if (uses_semantic(mode) && result.semantic_skipped) continue;
    const std::string name(to_string(mode));
    run.dynamics = mode;
    run.out = options.out / name;
    AblationRow row;
    row.mode = mode;
    row.run = run_sequence(run, stop, [&](const Progress& p) {
      if (progress) progress(mode, p);
    });
    if (row.run.interrupted) break;
    row.trajectory = evaluate_trajectory(row.run.trajectory, sequence.groundtruth, (run.out / "trajectory.txt").string(),
                                         (options.sequence / "groundtruth.txt").string());
    if (mode != DynamicsMode::none && options.max_frames == 0 && fs::is_directory(options.sequence / "dynamic_mask")) {
      row.masks = evaluate_masks(run.out / "masks", options.sequence / "dynamic_mask");
    }
    write_image(options.out / ("trajectory_" + name + ".png"),
                plot_trajectory(row.run.trajectory, sequence.groundtruth, result.sequence + ", " + name));
    result.rows.push_back(std::move(row));
  }
  result.interrupted = stop.load();
  if (result.rows.empty()) return result;

  std::vector<std::pair<std::string, AteResult<double>>> errors;
  for (const AblationRow& row : result.rows) errors.emplace_back(to_string(row.mode), row.trajectory.ate);
  write_image(options.out / "ate_over_time.png", plot_errors(errors, result.sequence));
  if (const cv::Mat sheet = overlays(result, sequence, options.out); !sheet.empty()) write_image(options.out / "overlays.png", sheet);
  if (options.map) {
    const AblationRow& last = result.rows.back();
    const fs::path file = options.out / std::string(to_string(last.mode)) / "map.ot";
    const std::unique_ptr<octomap::AbstractOcTree> tree(octomap::AbstractOcTree::read(file.string()));
    const auto* colour = dynamic_cast<const octomap::ColorOcTree*>(tree.get());
    if (colour == nullptr) throw InputError(file.string(), 0, "cannot be read back");
    write_image(options.out / "map.png", render_map(*colour, view_behind(last.run.trajectory.front().T_w_c)));
  }
  write_text(options.out / "tables.txt", to_text(result));
  write_text(options.out / "ablation.json", to_json(result).dump(2) + "\n");
  return result;
}

std::string to_text(const Ablation& ablation) {
  std::string text = table(ablation, "Absolute trajectory error [m], " + ablation.sequence, ate) + '\n' +
                     table(ablation, "Relative pose error, translation [m/s]", rpe_translation) + '\n' +
                     table(ablation, "Relative pose error, rotation [deg/s]", rpe_rotation) + '\n';
  text += fmt::format("{:<11}{:>9}{:>9}{:>9}{:>12}{:>10}{:>9}{:>11}\n", "", "tracked", "frames", "fps", "tracking ms", "recall", "IoU", "precision");
  for (const AblationRow& row : ablation.rows) {
    const auto stage = row.run.stages.find("tracking");
    text += fmt::format("{:<11}{:>9}{:>9}{:>9.1f}{:>12.1f}", to_string(row.mode), row.run.tracked, row.run.frames, row.run.fps,
                        stage != row.run.stages.end() ? stage->second.median_ms : 0.0);
    if (row.masks) text += fmt::format("{:>10.3f}{:>9.3f}{:>11.3f}", row.masks->recall, row.masks->iou, row.masks->precision);
    text += '\n';
  }
  if (ablation.semantic_skipped) text += "semantic and both were not run: the sequence has no label/ folder and no --masks were given\n";
  return text;
}

nlohmann::json to_json(const Ablation& ablation) {
  nlohmann::json j{{"sequence", ablation.sequence}, {"semantic_skipped", ablation.semantic_skipped}, {"modes", nlohmann::json::object()}};
  const Statistics<double>* base = nullptr;
  for (const AblationRow& row : ablation.rows) {
    if (row.mode == DynamicsMode::none) base = &ate(row);
    nlohmann::json mode = to_json(row.trajectory);
    mode["frames"] = row.run.frames;
    mode["tracked"] = row.run.tracked;
    mode["fps"] = row.run.fps;
    if (row.masks) mode["masks"] = to_json(*row.masks);
    if (base != nullptr) mode["ate_improvement_percent"] = improvement_percent(base->rmse, ate(row).rmse);
    j["modes"][std::string(to_string(row.mode))] = std::move(mode);
  }
  return j;
}

}  // namespace dynslam::runtime
