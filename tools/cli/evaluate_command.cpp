// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate_command.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/evaluation/evaluate.hpp"
#include "dynslam/runtime/evaluation/map_leftovers.hpp"
#include "dynslam/runtime/evaluation/mask_faults.hpp"
#include "dynslam/runtime/slam/track_result.hpp"
#include "format_options.hpp"
#include "progress_line.hpp"
#include "validators.hpp"
#include "warnings.hpp"

namespace dynslam::app {
namespace {

template <class Report>
int print(const Report& report, bool json) {
  std::cout << (json ? runtime::to_json(report).dump() + "\n" : runtime::to_text(report));
  return 0;
}

std::string faults_line(const runtime::MaskFaultReport& report, const std::string& out) {
  std::string text = fmt::format("{} masks in {}", report.masks, out);
  if (report.without_truth > 0)
    text +=
        fmt::format(", {} of them without the true mask, which dynamic_mask/ lacks", report.without_truth);
  if (report.no_truth) text += "; the sequence has no true masks (dynamic_mask/)";
  return text + (report.marked == 0 ? "\nnone of the masks marks anything\n" : "\n");
}

int write_faults(const runtime::MaskFaultOptions& options) {
  runtime::MaskFaultReport report;
  {
    ProgressLine line;
    report = runtime::write_mask_faults(options, [&](std::size_t done, std::size_t total) {
      line.show(fmt::format("{}/{} masks", done, total));
    });
  }
  const std::string out = options.out.string();
  if (report.replaced > 0)
    warn({fmt::format("{} masks that {} held before are replaced", report.replaced, out)});
  if (report.left > 0) warn({fmt::format("{} still holds {} other masks", out, report.left)});
  std::cout << faults_line(report, out);
  return 0;
}

}  // namespace

struct EvaluateCommand::Options {
  CLI::App* trajectory = nullptr;
  CLI::App* masks = nullptr;
  CLI::App* faults = nullptr;
  std::filesystem::path estimate, groundtruth, predicted, truth;
  runtime::MaskFaultOptions fault;
  runtime::EvaluationOptions evaluation;
  runtime::MaskOptions reading_masks, reading_truth;
  int widen = 0;
  bool moving = false;
  bool map = false;
  bool json = false;
};

/// eval-masks, and what it takes.
void EvaluateCommand::add_mask_options(CLI::App& app, Options& o) {
  o.masks = app.add_subcommand("eval-masks", "IoU, recall and precision of masks");
  o.masks->add_option("predicted", o.predicted, "Folder of PNG masks")->required();
  o.masks->add_option("truth", o.truth,
                      "Folder of true masks of the same names; without it: the share of pixels that masks "
                      "cover, which are false alarms where nothing moves");
  o.masks
      ->add_option("--widen", o.widen,
                   "Pixels by which the truth is widened before what lies beyond it counts as spill")
      ->capture_default_str()
      ->check(whole_in(0, 1000));
  const auto add_labels = [&](const char* name, std::vector<std::string>& labels, const char* whose) {
    o.masks
        ->add_option(name, labels,
                     fmt::format("What the values of the {} masks mean, as for run: voc, coco, cityscapes, "
                                 "instances, binary, or 15=person,...",
                                 whose))
        ->delimiter(',')
        ->allow_extra_args(false)
        ->type_name("WORDS");
  };
  add_labels("--mask-labels", o.reading_masks.labels, "predicted");
  add_labels("--truth-labels", o.reading_truth.labels, "true");
  o.masks->add_flag("--moving", o.moving,
                    "Of masks of dynslam, count what moves (255), and not what only may (128)")
      ->excludes("--mask-labels");
  o.masks->add_flag("--json", o.json, "Print JSON");
}

EvaluateCommand::EvaluateCommand(CLI::App& app) : o_(std::make_unique<Options>()) {
  Options& o = *o_;
  o.trajectory = app.add_subcommand("eval", "ATE and RPE (1 s) of a trajectory, as TUM's tools compute them");
  o.trajectory
      ->add_option("estimate", o.estimate,
                   "Trajectory in TUM format, or the folder of a run, of which both are compared: in the "
                   "end, and as the frames came")
      ->required();
  o.trajectory
      ->add_option("groundtruth", o.groundtruth,
                   "Ground truth in TUM format, or the folder of a sequence, or its bag")
      ->required();
  add_format_options(*o.trajectory, o.evaluation.reading.format, o.evaluation.reading.topics,
                     o.evaluation.reading.rate);
  o.trajectory
      ->add_option_function<std::string>(
          "--align",
          [&o](const std::string& name) { o.evaluation.alignment = *runtime::parse_alignment(name); },
          "How the estimate is laid on the ground truth for the ATE: se3 (rigid, least squares), sim3 (and a "
          "scale), first (by the first pair of poses) or none")
      ->default_str("se3")
      ->check(CLI::IsMember({"se3", "sim3", "first", "none"}));
  o.trajectory
      ->add_option_function<std::string>(
          "--offset",
          [&o](const std::string& value) {
            o.evaluation.find_offset = value == "auto";
            if (value != "auto") o.evaluation.offset = std::stod(value);
          },
          "Seconds to add to the estimate's times, or auto: found by how both turn and move")
      ->type_name("S|auto")
      ->check(auto_or(number_in(-1e12, 1e12)));
  o.trajectory->add_option(
      "--body-pose", o.evaluation.body_pose,
      "The camera's pose on the body that the ground truth is of: a file with the four rows "
      "of a matrix, or tx ty tz qx qy qz qw");
  o.trajectory->add_flag(
      "--map", o.map,
      "Of a run's folder also: voxels of the map that hold what the sequence's dynamic_mask/ has");
  o.trajectory->add_flag("--json", o.json, "Print JSON");
  add_mask_options(app, o);
  o.faults = app.add_subcommand("mask-faults", "Write wrong masks for a sequence, to see what they cost");
  o.faults->add_option("sequence", o.fault.sequence, "Folder of a sequence with ground truth, or its bag")
      ->required();
  o.faults->add_option("out", o.fault.out, "Folder to make, for run --masks")->required();
  o.faults
      ->add_option_function<std::string>(
          "--fault", [&o](const std::string& name) { o.fault.fault = *runtime::parse_mask_fault(name); },
          fmt::format("{}", fmt::join(runtime::kMaskFaultNames, ", ")))
      ->required()
      ->check(CLI::IsMember(
          std::vector<std::string>(runtime::kMaskFaultNames.begin(), runtime::kMaskFaultNames.end())));
  add_camera_option(*o.faults, o.fault.reading.camera);
  add_format_options(*o.faults, o.fault.reading.format, o.fault.reading.topics, o.fault.reading.rate);
  o.faults->add_option("--seed", o.fault.seed, "Of random blobs")->capture_default_str()->check(whole());
}

EvaluateCommand::~EvaluateCommand() = default;

bool EvaluateCommand::chosen() const {
  return o_->trajectory->parsed() || o_->masks->parsed() || o_->faults->parsed();
}

int EvaluateCommand::run() const {
  const Options& o = *o_;
  if (*o.trajectory && o.map) {
    if (!std::filesystem::is_directory(o.estimate))
      throw runtime::UsageError("--map needs the folder of a run, not a trajectory");
    const auto report = runtime::evaluate_run(o.estimate, o.groundtruth, o.evaluation);
    const auto leftovers = runtime::map_leftovers(o.estimate, o.groundtruth, o.evaluation.reading);
    nlohmann::json j = runtime::to_json(report);
    j["map"] = runtime::to_json(leftovers);
    std::cout << (o.json ? j.dump() + "\n" : runtime::to_text(report) + runtime::to_text(leftovers));
    return 0;
  }
  if (*o.trajectory && std::filesystem::is_directory(o.estimate))
    return print(runtime::evaluate_run(o.estimate, o.groundtruth, o.evaluation), o.json);
  if (*o.trajectory)
    return print(runtime::evaluate_trajectory(o.estimate, o.groundtruth, o.evaluation), o.json);
  if (*o.masks) {
    runtime::MaskOptions reading = o.reading_masks;
    if (o.moving)
      reading.labels = {fmt::format("{}=person", runtime::kMovesNow), fmt::format("{}=at rest", runtime::kMayMove)};
    return o.truth.empty() ? print(runtime::mask_shares(o.predicted, reading), o.json)
                           : print(runtime::evaluate_masks(o.predicted, o.truth, o.widen, reading, o.reading_truth), o.json);
  }
  return write_faults(o.fault);
}

}  // namespace dynslam::app
