// SPDX-License-Identifier: BSD-3-Clause
// Images of another size and rate than TUM's: all frames tracked, as well as pixels of that size allow.
#include <doctest/doctest.h>

#include "dynslam/runtime/evaluation/evaluate.hpp"
#include "run_fixture.hpp"

namespace {

namespace runtime = dynslam::runtime;

/// Renders a walk along xyz and runs it. @return absolute error [m]; fails where a frame is lost
double error_at(int width, int height, double rate, double seconds, const char* scenario,
                runtime::DynamicsMode mode) {
  const dynslam::test::TemporaryFolder folder;
  runtime::SynthOptions synth;
  synth.width = width;
  synth.height = height;
  synth.fps = rate;
  synth.frames = static_cast<int>(seconds * rate);
  synth.path = "xyz";
  synth.scenario = scenario;
  runtime::synthesize(synth, folder.path / "sequence");
  runtime::RunOptions run;
  run.sequence = folder.path / "sequence";
  run.out = folder.path / "run";
  run.dynamics = mode;
  run.map = false;
  const auto summary = runtime::run_sequence(run, dynslam::test::kNeverStop);
  CHECK(summary.frames == static_cast<std::size_t>(synth.frames));
  CHECK(summary.tracked == summary.frames);
  return runtime::evaluate_trajectory(run.out / "trajectory.txt", run.sequence / "groundtruth.txt")
      .ate.translation.rmse;
}

}  // namespace

TEST_CASE("small images at a low rate are tracked among people who walk") {
  CHECK(error_at(320, 240, 10, 2, "walking", runtime::DynamicsMode::geometric) < 0.008);
}

TEST_CASE("wide images at a high rate are tracked") {
  CHECK(error_at(848, 480, 60, 1.2, "empty", runtime::DynamicsMode::none) < 0.002);
}
