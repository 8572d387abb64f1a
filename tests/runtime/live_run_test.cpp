// SPDX-License-Identifier: BSD-3-Clause
// A recording played to the system as a camera would: `run --live`.
#include <doctest/doctest.h>

#include <atomic>
#include <chrono>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"
#include "dynslam/runtime/run/run_sequence.hpp"
#include "run/recorded_pace.hpp"
#include "run_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;
namespace fs = std::filesystem;
using test::bytes, test::kNeverStop, test::options_for;

namespace {

const fs::path& played() {
  static const test::WalkingSequence sequence(30);
  return sequence.path;
}

/// As fast as the files are read: no time passes between two frames.
RunOptions live_options_for(const fs::path& out, std::size_t queue) {
  RunOptions o = options_for(played(), out, DynamicsMode::both);
  o.schedule = Schedule::live;
  o.live_speed = 1000;
  o.live.queue = queue;
  return o;
}

std::string first_line(const fs::path& path) {
  std::ifstream in(path);
  std::string line;
  std::getline(in, line);
  return line;
}

}  // namespace

TEST_CASE("where all frames may wait, a live run has the results of one that waits for each") {
  const test::TemporaryFolder out;
  const RunSummary expected =
      run_sequence(options_for(played(), out.path / "run", DynamicsMode::both), kNeverStop);
  const RunSummary live = run_sequence(live_options_for(out.path / "live", 1000), kNeverStop);
  CHECK(expected.tracked == 30);
  CHECK(live.frames == 30);
  CHECK(live.tracked == 30);
  CHECK(live.dropped == 0);
  REQUIRE(live.live);
  CHECK(live.live->latency_max > 0);
  CHECK_FALSE(expected.live);
  for (const char* file :
       {"trajectory.txt", "trajectory_live.txt", "keyframes.txt", "map.sot", "masks/1000000.666667.png"})
    CHECK(bytes(out.path / "live" / file) == bytes(out.path / "run" / file));
  CHECK(first_line(out.path / "live" / "timings.csv").find(",frame,latency,mask_age_s,rss_mb,") !=
        std::string::npos);
  CHECK(first_line(out.path / "run" / "timings.csv").find(",frame,rss_mb,") != std::string::npos);
  const auto json = nlohmann::json::parse(bytes(out.path / "live" / "summary.json"));
  CHECK(json["live"]["reproducible"] == false);
  CHECK(json["live"]["dropped"] == 0);
  CHECK(json["live"]["latency"]["max_ms"] > 0);
  CHECK(json["live"]["latency"]["median_ms"] <= json["live"]["latency"]["p95_ms"]);
  CHECK(json["configuration"]["schedule"] == "live");
  CHECK_FALSE(nlohmann::json::parse(bytes(out.path / "run" / "summary.json")).contains("live"));
}

TEST_CASE("every frame of a live run is tracked, lost, broken or dropped") {
  const test::TemporaryFolder damaged, out;
  fs::copy(played(), damaged.path, fs::copy_options::recursive | fs::copy_options::overwrite_existing);
  fs::resize_file(load_sequence(damaged.path).frames[10].rgb, 1000);
  RunOptions o = live_options_for(out.path, 1);
  o.sequence = damaged.path;
  const RunSummary s = run_sequence(o, kNeverStop);
  CHECK(s.frames == 30);
  CHECK(s.broken == 1);
  CHECK(s.tracked + s.lost + s.broken + s.dropped == 30);
  CHECK(s.live->pushed == 29);
  CHECK(s.problems.size() == s.broken + s.lost);
  CHECK(read_trajectory(out.path / "trajectory.txt").size() == s.tracked);
}

TEST_CASE("a live run that is stopped, or fails, saves what it has") {
  const test::TemporaryFolder out;
  std::atomic<bool> stop{false};
  const RunSummary s = run_sequence(live_options_for(out.path / "a", 1000), stop, [&](const Progress& p) {
    if (p.done == 12) stop = true;
  });
  CHECK(s.interrupted);
  CHECK(s.frames == 12);
  CHECK(read_trajectory(out.path / "a" / "trajectory.txt").size() == 12);

  const auto fail = [](const Progress& p) {
    if (p.done == 12) throw std::runtime_error("the display is gone");
  };
  CHECK_THROWS_WITH_AS((void)run_sequence(live_options_for(out.path / "b", 1000), kNeverStop, fail),
                       "the display is gone", std::runtime_error);
  for (const char* file : {"trajectory.txt", "trajectory_live.txt"})
    CHECK(read_trajectory(out.path / "b" / file).size() == 12);

  RunOptions full = live_options_for(out.path / "c", 1000);
  full.map_memory = 1000;  // bytes: the first keyframe is too many
  CHECK_THROWS_WITH((void)run_sequence(full, kNeverStop), doctest::Contains("--map-memory"));
  CHECK(fs::exists(out.path / "c" / "trajectory.txt"));
}

TEST_CASE("a recording is never played faster than it was recorded, and a gap in it can be stopped") {
  const std::atomic<bool> go{false}, stop{true};
  RecordedPace pace(2, 10);
  const auto begin = std::chrono::steady_clock::now();
  CHECK(pace.wait(1e9, go));
  CHECK(pace.wait(1e9 + 0.1, go));
  CHECK(std::chrono::steady_clock::now() - begin >= std::chrono::milliseconds(49));
  CHECK(pace.wait(1e9 + 0.05, go));  // due long ago
  CHECK_FALSE(pace.wait(1e9 + 10, stop));
}

TEST_CASE("a gap that is longer than is waited for is skipped and counted, and the pace goes on behind it") {
  const std::atomic<bool> go{false};
  RecordedPace pace(1, 5);
  const auto begin = std::chrono::steady_clock::now();
  const auto passed = [&] { return std::chrono::steady_clock::now() - begin; };
  CHECK(pace.wait(0, go));    // a time, too
  CHECK(pace.wait(33, go));   // stamps in milliseconds
  CHECK(pace.wait(1e9, go));  // a clock that was set
  CHECK(passed() < std::chrono::seconds(5));
  CHECK(pace.skipped() == 2);
  CHECK(pace.first_skipped() == 33);
  const auto behind = passed();
  CHECK(pace.wait(1e9 + 0.05, go));
  CHECK(passed() - behind >= std::chrono::milliseconds(49));
}
