// SPDX-License-Identifier: BSD-3-Clause
// The main job on synthetic sequences: tracking, dynamics, files.
#include "dynslam/runtime/run/run_sequence.hpp"

#include <doctest/doctest.h>

#include <cstdlib>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/evaluation/evaluate.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"
#include "dynslam/runtime/io/tum_reader.hpp"
#include "dynslam/runtime/synth/synth.hpp"
#include "run_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;
namespace fs = std::filesystem;
using test::bytes, test::kNeverStop, test::options_for;

namespace {

/// People walking, rendered once for all tests of this file.
const fs::path& walking() {
  static const test::WalkingSequence sequence(40);
  return sequence.path;
}

}  // namespace

TEST_CASE("synthetic sequences are the same bytes for the same seed and differ with another") {
  const test::TemporaryFolder a, b, c;
  SynthOptions o;
  o.frames = 2;
  o.motion_blur = o.exposure_change = true;
  synthesize(o, a.path);
  synthesize(o, b.path);
  o.seed = 2;
  synthesize(o, c.path);
  for (const char* file : {"rgb/1000000.033333.png", "depth/1000000.033333.png", "label/1000000.033333.png",
                           "groundtruth.txt"}) {
    CHECK(bytes(a.path / file) == bytes(b.path / file));
    CHECK_FALSE(bytes(a.path / file).empty());
  }
  CHECK(bytes(a.path / "rgb/1000000.033333.png") != bytes(c.path / "rgb/1000000.033333.png"));
  o.path = "spiral";
  CHECK_THROWS_AS(synthesize(o, a.path), UsageError);
}

TEST_CASE(
    "synthetic ground truth, depth and masks agree: static surfaces reproject, moving objects are masked") {
  const Sequence sequence = load_sequence(walking());
  const CameraConfig camera = load_camera(sequence.camera_hint);
  const RgbdFrame a = decode_frame(sequence.frames[0], 0, camera),
                  b = decode_frame(sequence.frames[30], 30, camera);
  const cv::Mat label = cv::imread((walking() / "label" / (a.stamp + ".png")).string(), cv::IMREAD_UNCHANGED);
  const cv::Mat moving =
      cv::imread((walking() / "dynamic_mask" / (a.stamp + ".png")).string(), cv::IMREAD_UNCHANGED);
  const SE3d T = sequence.groundtruth[30].T_w_c.inverse() * sequence.groundtruth[0].T_w_c;
  int compared = 0, agree = 0, movers = 0;
  for (int v = 0; v < 480; v += 3) {
    for (int u = 0; u < 640; u += 3) {
      movers += moving.at<std::uint8_t>(v, u) != 0 ? 1 : 0;
      const float z = a.depth.at<float>(v, u);
      if (!(z > 0) || label.at<std::uint8_t>(v, u) == 1 || moving.at<std::uint8_t>(v, u) != 0) continue;
      const Eigen::Vector3d p = T * *camera.model.unproject(Eigen::Vector2d(u, v), static_cast<double>(z));
      const auto x = camera.model.project(p);
      if (!x || x->x() < 0 || x->y() < 0 || x->x() > 639 || x->y() > 479) continue;
      const double d =
          static_cast<double>(b.depth.at<float>(static_cast<int>(x->y()), static_cast<int>(x->x())));
      if (!(d > p.z() - 0.3)) continue;  // hidden by a person by then
      ++compared;
      agree += std::abs(d - p.z()) < 0.03 + 0.01 * p.z() * p.z() ? 1 : 0;
    }
  }
  CHECK(compared > 5000);
  CHECK(agree > compared * 9 / 10);
  CHECK(movers > 500);
}

TEST_CASE("a folder without masks for this sequence is an error, a few missing masks are reported") {
  const test::TemporaryFolder empty, some, out;
  RunOptions o = options_for(walking(), out.path / "none", DynamicsMode::semantic);
  o.max_frames = 5;
  o.map = false;
  o.masks = empty.path;
  CHECK_THROWS_WITH_AS((void)run_sequence(o, kNeverStop), doctest::Contains("has no mask for any frame"),
                       InputError);
  CHECK_FALSE(fs::exists(out.path / "none" / "trajectory.txt"));  // before anything is computed
  const Sequence sequence = load_sequence(walking());
  for (std::size_t i = 0; i < 3; ++i) {
    const std::string name = sequence.frames[i].stamp + ".png";
    fs::copy_file(walking() / "label" / name, some.path / name);
  }
  o.masks = some.path;
  o.out = out.path / "some";
  const RunSummary summary = run_sequence(o, kNeverStop);
  REQUIRE(summary.problems.size() == 1);
  CHECK(summary.problems[0].find("2 of 5 frames have no mask") == 0);
}

TEST_CASE("TUM's figures of reference.tsv are reproduced to the last digit") {
  const char* data = std::getenv("DYNSLAM_DATA");
  const fs::path folder = fs::path(data != nullptr ? data : "") / "trajectories";
  if (data == nullptr || !fs::exists(folder / "reference.tsv")) {
    MESSAGE("skipped: DYNSLAM_DATA does not name a folder with trajectories/reference.tsv");
    return;
  }
  std::ifstream table(folder / "reference.tsv");
  std::string line;
  std::getline(table, line);
  int rows = 0;
  while (std::getline(table, line)) {
    std::istringstream in(line);
    std::string name;
    std::size_t pairs = 0;
    in >> name >> pairs;
    const fs::path truth = folder / "groundtruth" / (name.substr(0, name.find("__")) + ".txt");
    const auto report = evaluate_trajectory(folder / "est" / (name + ".txt"), truth);
    CAPTURE(name);
    CHECK(report.ate.pairs == pairs);
    for (const double ours :
         {report.ate.translation.rmse, report.ate.translation.mean, report.ate.translation.std,
          report.rpe.translation.rmse, report.rpe.translation.std, report.rpe.rotation_deg.rmse,
          report.rpe.rotation_deg.std}) {
      std::string theirs;
      in >> theirs;
      char text[32];
      std::snprintf(text, sizeof text, "%.6f", ours);
      CHECK(theirs == text);
    }
    ++rows;
  }
  CHECK(rows == 9);
}
