// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate_command.hpp"

#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>

#include "dynslam/runtime/evaluation/evaluate.hpp"

namespace dynslam::app {
namespace {

template <class Report>
int print(const Report& report, bool json) {
  std::cout << (json ? runtime::to_json(report).dump() + "\n" : runtime::to_text(report));
  return 0;
}

}  // namespace

struct EvaluateCommand::Options {
  CLI::App* trajectory = nullptr;
  CLI::App* masks = nullptr;
  std::filesystem::path estimate, groundtruth, predicted, truth;
  bool json = false;
};

EvaluateCommand::EvaluateCommand(CLI::App& app) : o_(std::make_unique<Options>()) {
  Options& o = *o_;
  o.trajectory = app.add_subcommand("eval", "ATE and RPE (1 s) of a trajectory, as TUM's tools compute them");
  o.trajectory->add_option("estimate", o.estimate, "Trajectory in TUM format")->required();
  o.trajectory->add_option("groundtruth", o.groundtruth, "Ground truth in TUM format")->required();
  o.trajectory->add_flag("--json", o.json, "Print JSON");
  o.masks = app.add_subcommand("eval-masks", "IoU, recall and precision of masks");
  o.masks->add_option("predicted", o.predicted, "Folder of PNG masks")->required();
  o.masks->add_option("truth", o.truth, "Folder of true masks of the same names")->required();
  o.masks->add_flag("--json", o.json, "Print JSON");
}

EvaluateCommand::~EvaluateCommand() = default;

bool EvaluateCommand::chosen() const {
  return o_->trajectory->parsed() || o_->masks->parsed();
}

int EvaluateCommand::run() const {
  const Options& o = *o_;
  if (*o.trajectory) return print(runtime::evaluate_trajectory(o.estimate, o.groundtruth), o.json);
  return print(runtime::evaluate_masks(o.predicted, o.truth), o.json);
}

}  // namespace dynslam::app
