// SPDX-License-Identifier: BSD-3-Clause
// A camera that reads its rows one after the other while it turns, against the synthetic office's truth.
#include <doctest/doctest.h>

#include <cmath>
#include <fstream>
#include <optional>
#include <string>

#include "dynslam/runtime/evaluation/evaluate.hpp"
#include "dynslam/runtime/inspect/readout.hpp"
#include "dynslam/runtime/io/camera.hpp"
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

  // What the camera's file does not say, the images do.
  const ReadoutReport report =
      measure_readout(load_sequence(rolling), load_camera((folder.path / "global.txt").string()));
  CAPTURE(report.why_not);
  REQUIRE(report.readout);
  CHECK(std::abs(*report.readout - 0.024) < 0.004);
  CHECK(report.trials.front().assumed == 0);
  CHECK(report.trials.front().tracked == 40);
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
