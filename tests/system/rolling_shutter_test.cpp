// SPDX-License-Identifier: BSD-3-Clause
// A camera that reads its rows one after the other while it turns, against the synthetic office's truth.
#include <doctest/doctest.h>
#include <fmt/format.h>

#include <atomic>
#include <cmath>
#include <fstream>
#include <optional>
#include <string>

#include "dynslam/runtime/evaluation/evaluate.hpp"
#include "dynslam/runtime/inspect/inspect.hpp"
#include "dynslam/runtime/inspect/readout.hpp"
#include "dynslam/runtime/io/camera.hpp"
#include "error_text.hpp"
#include "run_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

/// ATE of a run with the camera of `file` [m]. @param readout  in place of its own
double error_with(const std::filesystem::path& sequence, const std::filesystem::path& file,
                  const std::filesystem::path& out, std::optional<double> readout = {}) {
  RunOptions options;
  options.sequence = sequence;
  options.out = out;
  options.camera = file.string();
  options.readout_time = readout;
  options.dynamics = DynamicsMode::geometric;
  options.map = false;
  CHECK(run_sequence(options, test::kNeverStop).tracked == 40);
  return evaluate_trajectory(out / "trajectory.txt", sequence / "groundtruth.txt").ate.translation.rmse;
}

}  // namespace

TEST_CASE("rows that are read one after the other are brought to one time: the error is a fraction") {
  const test::TemporaryFolder folder;
  SynthOptions synth;
  synth.frames = 40;
  synth.scenario = "empty";
  synth.path = "rpy";
  synth.readout_time = 0.024;
  synth.width = 320;
  synth.height = 240;
  const auto rolling = folder.path / "rolling", camera = rolling / "camera.txt";
  synthesize(synth, rolling);
  CHECK(load_camera(camera.string()).readout_time == 0.024);

  std::ifstream in(camera);
  std::ofstream global(folder.path / "global.txt");
  for (std::string line; std::getline(in, line);) {
    if (!line.starts_with("readout_time")) global << line << "\n";
  }
  global.close();
  const double with = error_with(rolling, camera, folder.path / "with");
  const double without = error_with(rolling, folder.path / "global.txt", folder.path / "without");
  CAPTURE(with);
  CAPTURE(without);
  CHECK(with < without / 2);
  // An option says the same as a camera's file, to the last bit.
  (void)error_with(rolling, camera, folder.path / "none", 0.0);
  CHECK(test::bytes(folder.path / "none" / "trajectory.txt") ==
        test::bytes(folder.path / "without" / "trajectory.txt"));
  (void)error_with(rolling, folder.path / "global.txt", folder.path / "given", 0.024);
  CHECK(test::bytes(folder.path / "given" / "trajectory.txt") ==
        test::bytes(folder.path / "with" / "trajectory.txt"));
  CHECK(without > 0.004);
}

TEST_CASE("a readout is measured from images, with an interval that holds it, or refused") {
  const test::TemporaryFolder folder;
  SynthOptions synth;
  synth.frames = 60;
  synth.scenario = "empty";
  synth.path = "rpy";
  for (const double truth : {0.024, 0.0}) {
    CAPTURE(truth);
    synth.readout_time = truth;
    const auto made = folder.path / (truth == 0 ? "global" : "rolling");
    synthesize(synth, made);
    const Sequence sequence = load_sequence(made);
    const ReadoutReport report = measure_readout(sequence, camera_of(sequence));
    CAPTURE(report.why_not);
    REQUIRE(report.readout);
    CAPTURE(*report.readout);
    CAPTURE(report.half_width);
    CHECK(std::abs(*report.readout - truth) < report.half_width);
    CHECK(report.half_width < 0.007);
    CHECK(report.trials.front().assumed == 0);
    CHECK(report.trials.front().tracked == 60);
    // `info` names it where the camera's file does not, and nothing where there is nothing.
    std::ifstream in(made / "camera.txt");
    std::ofstream silent(folder.path / "silent.txt");
    for (std::string line; std::getline(in, line);) {
      if (!line.starts_with("readout_time")) silent << line << "\n";
    }
    silent.close();
    InspectOptions info;
    info.camera = (folder.path / "silent.txt").string();
    const std::string said = fmt::format("{}", fmt::join(inspect_sequence(made, info).warnings, "\n"));
    CAPTURE(said);
    CHECK(test::mentions(said, "a camera file with readout_time = 0.02") == (truth != 0));
    CHECK(test::mentions(said, "the rows of colour images") == (truth != 0));
    // A run says so, once and with the key; whatever it masks, it has no false alarm.
    for (const DynamicsMode mode : {DynamicsMode::none, DynamicsMode::geometric}) {
      RunOptions run;
      run.sequence = made;
      run.out = folder.path / "run";
      run.camera = info.camera;
      run.map = false;
      run.dynamics = mode;
      const std::atomic<bool> never{false};
      const auto warnings = run_sequence(run, never).warnings;
      CAPTURE(fmt::format("{}", fmt::join(warnings, "\n")));
      REQUIRE(warnings.size() == (truth != 0 ? 1 : 0));
      if (truth != 0) CHECK(test::mentions(warnings.front(), "readout_time"));
      run.readout_time = 0;  // who says so means it
      CHECK(run_sequence(run, never).warnings.empty());
    }
    // The first second turns too little: 0.013 with nothing beside it would be wrong of a global shutter.
    Sequence first = sequence;
    first.frames.resize(30);
    const ReadoutReport vague = measure_readout(first, camera_of(first));
    if (vague.readout) CHECK(std::abs(*vague.readout - truth) < vague.half_width);
    CHECK((vague.readout || vague.why_not.starts_with("rows ")));
    // At 5 Hz nothing tells how the camera moves meanwhile, however quickly it does.
    Sequence slow = sequence;
    slow.frames.clear();
    for (std::size_t i = 0; i < sequence.frames.size(); i += 6) slow.frames.push_back(sequence.frames[i]);
    CHECK(measure_readout(slow, camera_of(slow)).why_not.starts_with("frames are 0.20 s apart"));
  }
}

TEST_CASE("the readout of a camera that stands still cannot be measured, and that is said") {
  const test::TemporaryFolder folder;
  SynthOptions synth;
  synth.frames = 12;
  synth.scenario = "empty";
  synth.path = "static";
  synth.width = 320;
  synth.height = 240;
  synthesize(synth, folder.path / "s");
  const Sequence sequence = load_sequence(folder.path / "s");
  const ReadoutReport report = measure_readout(sequence, camera_of(sequence));
  CHECK_FALSE(report.readout);
  CHECK(report.why_not == "the camera moves too little");
}
