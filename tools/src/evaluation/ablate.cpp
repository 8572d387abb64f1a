// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/evaluation/ablate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <span>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/evaluation/map_render.hpp"
#include "dynslam/runtime/evaluation/plot.hpp"
#include "dynslam/runtime/io/atomic_file.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "dynslam/runtime/io/map_io.hpp"
#include "dynslam/runtime/io/tum_reader.hpp"
#include "dynslam/runtime/nets/onnx_segmenter.hpp"
#include "io/frame_images.hpp"
#include "io/make_folder.hpp"

namespace dynslam::runtime {
namespace {

namespace fs = std::filesystem;

/// A measure of the paper's tables.
struct Measure {
  const char* title;
  const char* key;  // in ablation.json
  const Statistics<double>& (*of)(const TrajectoryReport&);
};
constexpr std::array<Measure, 3> kMeasures{{
    {"Absolute trajectory error [m]", "ate",
     [](const TrajectoryReport& r) -> const Statistics<double>& { return r.ate.translation; }},
    {"Relative pose error, translation [m/s]", "rpe_trans",
     [](const TrajectoryReport& r) -> const Statistics<double>& { return r.rpe.translation; }},
    {"Relative pose error, rotation [deg/s]", "rpe_rot",
     [](const TrajectoryReport& r) -> const Statistics<double>& { return r.rpe.rotation_deg; }},
}};

constexpr std::array<std::pair<const char*, double Statistics<double>::*>, 4> kFigures{{
    {"RMSE", &Statistics<double>::rmse},
    {"mean", &Statistics<double>::mean},
    {"median", &Statistics<double>::median},
    {"S.D.", &Statistics<double>::std},
}};

/// The row that Eq (13) compares with.
const TrajectoryReport* baseline(const Ablation& ablation) {
  for (const AblationRow& row : ablation.rows) {
    if (row.mode == DynamicsMode::none && row.trajectory) return &*row.trajectory;
  }
  return nullptr;
}

Table error_table(const Ablation& ablation, const Measure& measure) {
  Table table{measure.title, {"mode"}, {}};
  for (const auto& figure : kFigures) table.header.emplace_back(figure.first);
  for (const auto& figure : kFigures) table.header.push_back(std::string(figure.first) + " impr.");
  const TrajectoryReport* base = baseline(ablation);
  for (const AblationRow& row : ablation.rows) {
    std::vector<std::string> cells{std::string(to_string(row.mode))};
    for (const auto& figure : kFigures) {
      cells.push_back(row.trajectory ? cell(measure.of(*row.trajectory).*figure.second, 4) : "-");
    }
    if (row.mode != DynamicsMode::none && row.trajectory && base != nullptr) {
      for (const auto& figure : kFigures) {
        cells.push_back(cell(
            improvement_percent(measure.of(*base).*figure.second, measure.of(*row.trajectory).*figure.second),
            2, " %"));
      }
    }
    table.rows.push_back(std::move(cells));
  }
  return table;
}

double coverage_percent(const RunSummary& run) {
  return run.frames > 0 ? 100.0 * static_cast<double>(run.tracked) / static_cast<double>(run.frames) : 0.0;
}

Table run_table(const Ablation& ablation) {
  Table table{"Coverage, speed and masks",
              {"mode", "frames", "tracked", "lost", "broken", "coverage", "frames/s", "tracking [ms]",
               "recall", "IoU", "precision"},
              {}};
  for (const AblationRow& row : ablation.rows) {
    const RunSummary& run = row.run;
    const auto stage = run.stages.find("tracking");
    std::vector<std::string> cells{std::string(to_string(row.mode)),
                                   std::to_string(run.frames),
                                   std::to_string(run.tracked),
                                   std::to_string(run.lost),
                                   std::to_string(run.broken),
                                   cell(coverage_percent(run), 1, " %"),
                                   cell(run.fps, 1),
                                   stage != run.stages.end() ? cell(stage->second.median_ms, 1) : "-"};
    if (row.masks) {
      for (const double v : {row.masks->recall, row.masks->iou, row.masks->precision})
        cells.push_back(cell(v, 3));
    } else {
      cells.insert(cells.end(), 3, "-");
    }
    table.rows.push_back(std::move(cells));
  }
  return table;
}

/// What the tables leave open, one line each.
std::vector<std::string> notes(const Ablation& ablation) {
  std::vector<std::string> lines;
  if (baseline(ablation) != nullptr) {
    lines.emplace_back("impr.: improvement over none in percent (Eq 13)");
  }
  lines.emplace_back(ablation.method == MotionMethod::paper
                         ? "the modes differ by their masks alone, as those of dynslam run --method paper"
                         : "the modes differ by their masks alone; dynslam run adds to each what it can use");
  if (ablation.semantic_skipped) {
    lines.emplace_back(
        "semantic and both were not run: the sequence has no label/ folder, and neither --model nor --masks "
        "was given");
  }
  for (const AblationRow& row : ablation.rows) {
    if (!row.trajectory)
      lines.push_back(fmt::format("{}: no ATE and RPE: {}", to_string(row.mode), row.not_comparable));
    if (row.trajectory) {
      for (const std::string& note : row.trajectory->notes)
        lines.push_back(fmt::format("{}: {}", to_string(row.mode), note));
    }
  }
  if (ablation.interrupted) lines.emplace_back("interrupted: modes that are missing were not finished");
  return lines;
}

cv::Mat read_mask(const fs::path& path) {
  return fs::exists(path) ? read_image(path, cv::IMREAD_GRAYSCALE) : cv::Mat();
}

/// Writes out/overlays.png (rows: truth where known and modes; columns: frames spread over the sequence) and
/// the single pictures in out/<mode>/overlays/. Frames that cannot be read leave a grey place.
void write_overlays(const Ablation& ablation, const Sequence& sequence, const fs::path& out) {
  constexpr std::size_t kColumns = 5;
  std::vector<const FrameRecord*> frames;
  std::vector<cv::Mat> colour;
  std::vector<std::string> captions;
  for (std::size_t k = 0; k < std::min(kColumns, sequence.frames.size()); ++k) {
    const std::size_t columns = std::min(kColumns, sequence.frames.size());
    const FrameRecord& frame = sequence.frames[(2 * k + 1) * sequence.frames.size() / (2 * columns)];
    frames.push_back(&frame);
    captions.push_back(fmt::format("{:.2f} s", frame.t_rgb - sequence.frames.front().t_rgb));
    try {
      colour.push_back(read_image(frame, ImageSource::Kind::colour));
    } catch (const InputError&) {  // a broken frame: reported by the run
      colour.emplace_back();
    }
  }
  std::vector<SheetRow> rows;
  const auto add_row = [&](const std::string& caption, const fs::path& masks, const fs::path& single) {
    SheetRow row{caption, {}};
    for (std::size_t k = 0; k < frames.size(); ++k) {
      const std::string name = frames[k]->stamp + ".png";
      const cv::Mat mask = colour[k].empty() ? cv::Mat() : read_mask(masks / name);
      const bool usable = !mask.empty() && mask.size() == colour[k].size();
      row.pictures.push_back(usable ? overlay_mask(colour[k], mask) : cv::Mat());
      if (usable && !single.empty()) write_image(single / name, row.pictures.back());
    }
    rows.push_back(std::move(row));
  };
  if (fs::is_directory(sequence.root / "dynamic_mask")) add_row("truth", sequence.root / "dynamic_mask", {});
  for (const AblationRow& row : ablation.rows) {
    if (row.mode == DynamicsMode::none) continue;
    const std::string name(to_string(row.mode));
    make_folder(out / name / "overlays");
    add_row(name, out / name / "masks", out / name / "overlays");
  }
  if (!rows.empty()) write_image(out / "overlays.png", contact_sheet(rows, captions));
}

}  // namespace

Ablation ablate(const RunOptions& options, const std::atomic<bool>& stop,
                const std::function<void(DynamicsMode, const Progress&)>& progress) {
  const Sequence sequence = load_sequence(options.sequence, sequence_options(options));
  if (sequence.groundtruth.empty())
    throw sequence.truth_missing.empty()
        ? InputError((options.sequence / "groundtruth.txt").string(), 0,
                     "is missing: the ablation needs ground truth")
        : InputError(options.sequence.string(), 0,
                     "has no ground truth, which the ablation needs: " + sequence.truth_missing);
  RunOptions run = options;
  run.save_masks = true;
  if (run.tracker.additions == Additions::by_mode)
    run.tracker.additions = ablation_additions(run.tracker.method);
  const bool network = !run.segmentation.segmenter.model.empty();
  if (network) (void)OnnxSegmenter(run.segmentation.segmenter);  // is refused before the first mode has run
  if (run.masks.empty() && !network && fs::is_directory(options.sequence / "label"))
    run.masks = options.sequence / "label";

  Ablation result;
  result.method = options.tracker.method;
  result.sequence = options.sequence.filename().empty() ? options.sequence.parent_path().filename().string()
                                                        : options.sequence.filename().string();
  result.semantic_skipped = run.masks.empty() && !network;
  for (const DynamicsMode mode : kAblationModes) {
    if (stop.load()) break;
    if (uses_semantic(mode) && result.semantic_skipped) continue;
    const std::string name(to_string(mode));
    run.dynamics = mode;
    run.out = options.out / name;
    // Each mode goes on from the same map, and saves its own.
    if (!options.save_map.empty()) run.save_map = options.save_map / name;
    AblationRow row;
    row.mode = mode;
    row.run = run_sequence(run, stop, [&](const Progress& p) {
      if (progress) progress(mode, p);
    });
    if (row.run.interrupted) break;
    try {
      row.trajectory =
          evaluate_trajectory(row.run.trajectory, sequence.groundtruth, (run.out / "trajectory.txt").string(),
                              sequence.truth_file.string());
    } catch (const InputError& error) {  // one mode that fails is a result, too
      row.not_comparable = error.what();
    }
    if (mode != DynamicsMode::none && options.max_frames == 0 &&
        fs::is_directory(options.sequence / "dynamic_mask")) {
      row.masks = evaluate_masks(run.out / "masks", options.sequence / "dynamic_mask");
    }
    write_image(options.out / ("trajectory_" + name + ".png"),
                plot_trajectory(row.run.trajectory, sequence.groundtruth, result.sequence + ", " + name));
    result.rows.push_back(std::move(row));
  }
  result.interrupted = stop.load();
  if (result.rows.empty()) return result;

  std::vector<std::pair<std::string, AteResult<double>>> errors;
  for (const AblationRow& row : result.rows) {
    if (row.trajectory && row.trajectory->ate.pairs > 0)
      errors.emplace_back(to_string(row.mode), row.trajectory->ate);
  }
  if (!errors.empty()) write_image(options.out / "ate_over_time.png", plot_errors(errors, result.sequence));
  write_overlays(result, sequence, options.out);
  if (options.map) {
    const AblationRow& last = result.rows.back();
    const auto tree = load_map(options.out / std::string(to_string(last.mode)) / kMapFile);
    const SE3<double> start = last.run.trajectory.empty() ? SE3<double>() : last.run.trajectory.front().T_w_c;
    const MapView view = fit_view(*tree, view_behind(start));
    write_image(options.out / "map.png", render_map(*tree, view));
    // The first camera is taken to be level: its y axis points down.
    write_image(options.out / "map_height.png",
                render_map(*tree, view, MapColours::height, -start.rotation_matrix().col(1)));
  }
  write_file(options.out / "tables.txt", to_text(result));
  write_file(options.out / "tables.md", to_markdown(result));
  write_file(options.out / "ablation.json", to_json(result).dump(2) + "\n");
  return result;
}

std::vector<Table> tables(const Ablation& ablation) {
  std::vector<Table> result;
  for (const Measure& measure : kMeasures) result.push_back(error_table(ablation, measure));
  result.push_back(run_table(ablation));
  return result;
}

std::string to_text(const Ablation& ablation) {
  std::string text = fmt::format("Sequence: {}, method: {}\n", ablation.sequence, to_string(ablation.method));
  for (const Table& table : tables(ablation)) text += '\n' + to_text(table);
  text += '\n';
  for (const std::string& note : notes(ablation)) text += note + '\n';
  return text;
}

std::string to_markdown(const Ablation& ablation) {
  std::string text = fmt::format("## {}, method: {}\n", ablation.sequence, to_string(ablation.method));
  for (const Table& table : tables(ablation)) text += '\n' + to_markdown(table);
  text += '\n';
  for (const std::string& note : notes(ablation)) text += "- " + note + '\n';
  return text;
}

nlohmann::json to_json(const Ablation& ablation) {
  nlohmann::json j{{"sequence", ablation.sequence},
                   {"method", std::string(to_string(ablation.method))},
                   {"semantic_skipped", ablation.semantic_skipped},
                   {"interrupted", ablation.interrupted},
                   {"modes", nlohmann::json::object()}};
  const TrajectoryReport* base = baseline(ablation);
  for (const AblationRow& row : ablation.rows) {
    nlohmann::json mode =
        row.trajectory ? to_json(*row.trajectory) : nlohmann::json{{"not_comparable", row.not_comparable}};
    mode["frames"] = row.run.frames;
    mode["tracked"] = row.run.tracked;
    mode["lost"] = row.run.lost;
    mode["broken"] = row.run.broken;
    mode["coverage_percent"] = coverage_percent(row.run);
    mode["fps"] = row.run.fps;
    if (row.masks) mode["masks"] = to_json(*row.masks);
    if (base != nullptr && row.trajectory) {
      for (const Measure& m : kMeasures) {
        mode[std::string(m.key) + "_improvement_percent"] =
            improvement_percent(m.of(*base).rmse, m.of(*row.trajectory).rmse);
      }
    }
    j["modes"][std::string(to_string(row.mode))] = std::move(mode);
  }
  return j;
}

}  // namespace dynslam::runtime
