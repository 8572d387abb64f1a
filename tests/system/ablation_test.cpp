// SPDX-License-Identifier: BSD-3-Clause
// What each source of masks is worth, and what hard input costs, in figures. Sanitizers leave it out: the
// same code runs in the other tests.
#include <doctest/doctest.h>

#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "dynslam/runtime/evaluation/ablate.hpp"
#include "dynslam/runtime/evaluation/evaluate.hpp"
#include "dynslam/runtime/io/tum_reader.hpp"
#include "dynslam/runtime/run/run_sequence.hpp"
#include "dynslam/runtime/synth/synth.hpp"
#include "run_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;
namespace fs = std::filesystem;
using test::kNeverStop, test::options_for;

namespace {

constexpr int kFrames = 90;

double ate_of(const fs::path& out, const fs::path& sequence) {
  return evaluate_trajectory(out / "trajectory.txt", sequence / "groundtruth.txt").ate.translation.rmse;
}

}  // namespace

TEST_CASE(
    "moving objects ruin the baseline; both cuts its error to a tenth, and geometry alone finds the carried "
    "box") {
  const test::TemporaryFolder sequence, out;
  SynthOptions synth;  // what the demo shows, a box carried past the camera included
  synth.frames = kFrames;
  synth.path = "xyz";
  synth.seed = 2;
  synthesize(synth, sequence.path);
  std::map<DynamicsMode, double> ate;
  for (const auto mode :
       {DynamicsMode::none, DynamicsMode::semantic, DynamicsMode::geometric, DynamicsMode::both}) {
    const fs::path folder = out.path / std::string(to_string(mode));
    const RunSummary summary = run_sequence(options_for(sequence.path, folder, mode), kNeverStop);
    CHECK(summary.tracked == kFrames);
    CHECK(summary.lost == 0);
    ate[mode] = ate_of(folder, sequence.path);
    for (const char* file : {"keyframes.txt", "map.sot", "timings.csv", "summary.json"})
      CHECK(fs::file_size(folder / file) > 100);
    const auto json = nlohmann::json::parse(std::ifstream(folder / "summary.json"));
    CHECK(json["frames"] == kFrames);
    CHECK(json["stages"]["tracking"]["median_ms"].get<double>() > 0);
  }
  MESSAGE("ATE RMSE: none " << ate[DynamicsMode::none] << " semantic " << ate[DynamicsMode::semantic]
                            << " geometric " << ate[DynamicsMode::geometric] << " both "
                            << ate[DynamicsMode::both]);
  CHECK(ate[DynamicsMode::both] <= 0.1 * ate[DynamicsMode::none]);
  CHECK(ate[DynamicsMode::geometric] < 0.5 * ate[DynamicsMode::none]);
  CHECK(ate[DynamicsMode::both] < 0.01);
  CHECK(evaluate_masks(out.path / "geometric" / "masks", sequence.path / "box_mask").recall > 0.7);
  CHECK(evaluate_masks(out.path / "geometric" / "masks", sequence.path / "dynamic_mask").iou > 0.5);
}

TEST_CASE(
    "without moving objects and masks the modes of an ablation give the same poses; those of run need not") {
  // What an ablation compares are masks: where there are none, nothing else may tell its modes apart.
  const test::WalkingSequence sequence(25);
  const test::TemporaryFolder masks, out;
  for (const FrameRecord& frame : load_sequence(sequence.path).frames)
    cv::imwrite((masks.path / (frame.stamp + ".png")).string(), cv::Mat::zeros(480, 640, CV_8UC1));
  for (const auto method : {MotionMethod::paper, MotionMethod::full}) {
    for (const auto mode : {DynamicsMode::none, DynamicsMode::semantic}) {
      RunOptions o = options_for(sequence.path, out.path / std::string(to_string(mode)), mode);
      o.masks = masks.path;
      o.map = false;
      o.tracker.method = method;
      o.tracker.additions = ablation_additions(method);
      (void)run_sequence(o, kNeverStop);
    }
    CHECK(test::bytes(out.path / "none" / "trajectory.txt") ==
          test::bytes(out.path / "semantic" / "trajectory.txt"));
  }
}

TEST_CASE("the paper's method is the same in an ablation and in a run of each mode") {
  // A board that hides most of the view, and a jerk: what the additions are for.
  const test::TemporaryFolder sequence, out;
  SynthOptions synth;
  synth.frames = 45;
  synth.path = "xyz";
  synth.scenario = "board";
  synthesize(synth, sequence.path);
  const auto frames = load_sequence(sequence.path).frames;
  for (const std::size_t i : {15U, 30U}) {
    cv::Mat image = cv::imread(frames[i].rgb.string());
    cv::blur(image, image, {27, 1});
    cv::imwrite(frames[i].rgb.string(), image);
  }
  RunOptions o = options_for(sequence.path, out.path / "ablation", DynamicsMode::none);
  o.map = false;
  o.tracker.method = MotionMethod::paper;
  CHECK(ablate(o, kNeverStop).rows.size() == 4);
  for (const auto mode :
       {DynamicsMode::none, DynamicsMode::semantic, DynamicsMode::geometric, DynamicsMode::both}) {
    const std::string name(to_string(mode));
    CAPTURE(name);
    o.dynamics = mode;
    o.out = out.path / name;
    (void)run_sequence(o, kNeverStop);
    for (const char* file : {"trajectory.txt", "trajectory_live.txt", "keyframes.txt"})
      CHECK(test::bytes(out.path / "ablation" / name / file) == test::bytes(out.path / name / file));
  }
}

TEST_CASE("a carried board with most of the corners in view is not taken for the scene by geometry") {
  const test::TemporaryFolder sequence, out;
  SynthOptions synth;
  synth.frames = 60;
  synth.path = "xyz";
  synth.scenario = "board";
  synthesize(synth, sequence.path);
  (void)run_sequence(options_for(sequence.path, out.path / "none", DynamicsMode::none), kNeverStop);
  const RunSummary summary =
      run_sequence(options_for(sequence.path, out.path / "geometric", DynamicsMode::geometric), kNeverStop);
  CHECK(summary.tracked == 60);
  const double none = ate_of(out.path / "none", sequence.path),
               geometric = ate_of(out.path / "geometric", sequence.path);
  MESSAGE("ATE RMSE: none " << none << " geometric " << geometric);
  CHECK(none > 0.05);  // follows the board
  CHECK(geometric < 0.015);
}

TEST_CASE("frames that a jerk has smeared are tracked, and nearly in the right place") {
  const test::WalkingSequence sequence(60);
  const test::TemporaryFolder out;
  const auto frames = load_sequence(sequence.path).frames;
  for (const std::size_t i : {15U, 30U, 45U}) {
    cv::Mat image = cv::imread(frames[i].rgb.string());
    cv::blur(image, image, {27, 1});
    cv::imwrite(frames[i].rgb.string(), image);
  }
  const RunSummary summary =
      run_sequence(options_for(sequence.path, out.path, DynamicsMode::geometric), kNeverStop);
  CHECK(summary.lost == 0);
  const auto error =
      evaluate_trajectory(out.path / "trajectory.txt", sequence.path / "groundtruth.txt").ate.translation;
  CHECK(error.rmse < 0.01);
  CHECK(error.max < 0.05);
}
