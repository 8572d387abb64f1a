// SPDX-License-Identifier: BSD-3-Clause
// What happens when the input breaks, the view is lost, the user stops the run, or the machine is busy.
#include <doctest/doctest.h>

#include <algorithm>
#include <atomic>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <thread>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/evaluation/evaluate.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"
#include "dynslam/runtime/io/tum_reader.hpp"
#include "dynslam/runtime/run/run_sequence.hpp"
#include "run_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;
namespace fs = std::filesystem;
using test::bytes, test::kNeverStop, test::options_for;

namespace {

/// People two_seconds for two seconds, rendered once for all tests of this file.
const fs::path& two_seconds() {
  static const test::WalkingSequence sequence(60);
  return sequence.path;
}

}  // namespace

TEST_CASE("two runs give identical trajectories, masks and maps, with the machine idle and with it busy") {
  const test::TemporaryFolder out;
  for (const char* name : {"a", "b"}) {
    RunOptions o = options_for(two_seconds(), out.path / name, DynamicsMode::both);
    o.max_frames = 30;
    // The second run shares every core with other processes: what waits for what must not matter.
    std::atomic<bool> done{false};
    std::vector<std::jthread> load;
    if (o.out == out.path / "b") {
      for (unsigned k = 0; k < 2 * std::max(1U, std::thread::hardware_concurrency()); ++k) {
        load.emplace_back([&done] {
          while (!done.load(std::memory_order_relaxed)) {
          }
        });
      }
    }
    (void)run_sequence(o, kNeverStop);
    done = true;
  }
  for (const char* file :
       {"trajectory.txt", "trajectory_live.txt", "keyframes.txt", "map.sot", "masks/1000000.666667.png"}) {
    CHECK_FALSE(bytes(out.path / "a" / file).empty());
    CHECK(bytes(out.path / "a" / file) == bytes(out.path / "b" / file));
  }
}

TEST_CASE("broken and black frames are reported; after 20 black ones the camera finds itself within 10") {
  const test::TemporaryFolder damaged, out;
  fs::copy(two_seconds(), damaged.path, fs::copy_options::recursive | fs::copy_options::overwrite_existing);
  const Sequence sequence = load_sequence(damaged.path);
  fs::resize_file(sequence.frames[10].rgb, 1000);
  fs::remove(sequence.frames[11].depth);
  for (std::size_t i = 20; i < 40; ++i)
    cv::imwrite(sequence.frames[i].rgb.string(), cv::Mat::zeros(480, 640, CV_8UC3));
  RunOptions o = options_for(damaged.path, out.path, DynamicsMode::both);

  const RunSummary summary = run_sequence(o, kNeverStop);
  CHECK(summary.frames == 60);
  CHECK(summary.broken == 2);
  CHECK(summary.lost >= 20);
  CHECK(summary.lost <= 30);
  CHECK(summary.tracked == 58 - summary.lost);
  REQUIRE(summary.problems.size() == 2 + summary.lost);
  CHECK(summary.problems[0].find("is truncated") != std::string::npos);
  CHECK(summary.problems[1].find("cannot be opened") != std::string::npos);
  CHECK(read_trajectory(out.path / "trajectory.txt").size() == summary.tracked);
  CHECK(
      evaluate_trajectory(out.path / "trajectory.txt", damaged.path / "groundtruth.txt").ate.translation.max <
      0.02);
}

TEST_CASE("an interruption saves what was computed") {
  const test::TemporaryFolder out;
  std::atomic<bool> stop{false};
  const RunSummary summary = run_sequence(options_for(two_seconds(), out.path, DynamicsMode::geometric), stop,
                                          [&](const Progress& p) {
                                            if (p.done == 12) stop = true;
                                          });
  CHECK(summary.interrupted);
  for (const char* file : {"trajectory.txt", "trajectory_live.txt"})
    CHECK(read_trajectory(out.path / file).size() == 12);
  CHECK(fs::exists(out.path / "map.sot"));
  CHECK(nlohmann::json::parse(bytes(out.path / "summary.json"))["interrupted"] == true);
}

TEST_CASE("a failure in the middle, and a file that cannot be written, cost nothing else") {
  const test::TemporaryFolder out;
  RunOptions o = options_for(two_seconds(), out.path, DynamicsMode::geometric);
  fs::create_directories(out.path / "keyframes.txt");  // where a file should be
  const auto fail_at_12 = [](const Progress& p) {
    if (p.done == 12) throw std::runtime_error("the display is gone");
  };
  CHECK_THROWS_WITH_AS((void)run_sequence(o, kNeverStop, fail_at_12), "the display is gone",
                       std::runtime_error);
  for (const char* file : {"trajectory.txt", "trajectory_live.txt"})
    CHECK(read_trajectory(out.path / file).size() == 12);
  CHECK(fs::exists(out.path / "map.sot"));
  CHECK(nlohmann::json::parse(bytes(out.path / "summary.json"))["tracked"] == 12);
}

TEST_CASE("what cannot work is refused in one line, and what was computed before a failure is saved") {
  const test::TemporaryFolder out;
  RunOptions o = options_for(two_seconds(), out.path, DynamicsMode::both);
  o.masks.clear();
  CHECK_THROWS_AS((void)run_sequence(o, kNeverStop), UsageError);
  o = options_for(two_seconds(), "/proc/no/such", DynamicsMode::none);
  CHECK_THROWS_AS((void)run_sequence(o, kNeverStop), InputError);
  o = options_for(two_seconds(), out.path, DynamicsMode::none);
  o.camera = "fr9";
  CHECK_THROWS_AS((void)run_sequence(o, kNeverStop), UsageError);

  const test::TemporaryFolder masks;  // the sixth mask is unusable
  const Sequence sequence = load_sequence(two_seconds());
  cv::imwrite((masks.path / (sequence.frames[5].stamp + ".png")).string(), cv::Mat::zeros(10, 10, CV_8UC1));
  o = options_for(two_seconds(), out.path, DynamicsMode::semantic);
  o.masks = masks.path;
  CHECK_THROWS_AS((void)run_sequence(o, kNeverStop), InputError);
  CHECK(read_trajectory(out.path / "trajectory.txt").size() == 5);
}
