// SPDX-License-Identifier: BSD-3-Clause
// Nanoseconds from a list, a file or a clock to the trajectory.
#include "dynslam/runtime/io/time_stamp.hpp"

#include <doctest/doctest.h>

#include <chrono>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "dynslam/runtime/io/trajectory_io.hpp"
#include "dynslam/runtime/io/tum_reader.hpp"
#include "dynslam/runtime/live.hpp"
#include "dynslam/runtime/run/run_sequence.hpp"
#include "run_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;
namespace fs = std::filesystem;

namespace {

std::vector<std::string> first_words(const fs::path& file) {
  std::ifstream in(file);
  std::vector<std::string> result;
  for (std::string line; std::getline(in, line);)
    if (!line.starts_with('#')) result.push_back(line.substr(0, line.find(' ')));
  return result;
}

/// The lists of a sequence with other times in them, those of `stamps` for the first images.
void restamp(const fs::path& root, const std::vector<std::string>& stamps) {
  for (const char* name : {"rgb.txt", "depth.txt"}) {
    std::ifstream in(root / name);
    std::ostringstream text;
    std::size_t k = 0;
    for (std::string line; k < stamps.size() && std::getline(in, line);)
      if (!line.starts_with('#')) text << stamps[k++] << line.substr(line.find(' ')) << '\n';
    in.close();
    std::ofstream(root / name) << text.str();
  }
  fs::remove(root / "groundtruth.txt");
  fs::remove(root / "associations.txt");
}

}  // namespace

TEST_CASE("nanoseconds are read from decimals and from 19 digits, and printed as they were") {
  struct Case {
    const char* word;
    std::int64_t ns;
  };
  for (const Case& c :
       {Case{"1305031102.175304123", 1305031102175304123}, Case{"1305031102175304123", 1305031102175304123},
        Case{"1305031102.175304", 1305031102175304000}, Case{"1305031102", 1305031102000000000},
        Case{"0.000000001", 1}, Case{"+2.5", 2500000000}, Case{"1.0000000015", 1000000002},
        Case{"0.9999999999", 1000000000}, Case{"8999999999.999999999", 8999999999999999999},
        // Times all the same, whose nanoseconds are not said or too many.
        Case{"1.3e9", 0}, Case{"-1.5", 0}, Case{"130503110217530412", 0}, Case{"9999999999.5", 0},
        Case{".5", 0}}) {
    CAPTURE(c.word);
    const auto time = parse_time(c.word);
    REQUIRE(time);
    CHECK(time->ns == c.ns);
  }
  CHECK(parse_time("1305031102175304123")->t == 1305031102.175304123);
  CHECK(parse_time("1305031102.175304123")->t == 1305031102.175304123);
  CHECK(time_of(-1500000000).t == -1.5);
  CHECK(nanosecond_text(1305031102175304123) == "1305031102.175304123");
  CHECK(nanosecond_text(7) == "0.000000007");
  CHECK(nanosecond_text(-1500000000) == "-1.500000000");
  for (const char* word : {"", "nan", "inf", "1.2.3", "12a", "1305031102175304a23"})
    CHECK_FALSE(parse_time(word));
}

TEST_CASE("a run's trajectory has the nanoseconds of the list, and TUM's times as before") {
  const test::TemporaryFolder out;
  const test::WalkingSequence sequence(4);
  const auto times_of_run = [&](const std::vector<std::string>& stamps) {
    restamp(sequence.path, stamps);
    RunOptions o;
    o.sequence = sequence.path;
    o.out = out.path;
    o.camera = load_sequence(sequence.path).camera_hint.empty() ? "fr3" : "";
    o.dynamics = DynamicsMode::none;
    o.map = false;
    (void)run_sequence(o, test::kNeverStop);
    CHECK(first_words(out.path / "keyframes.txt").front() ==
          first_words(out.path / "trajectory.txt").front());
    return first_words(out.path / "trajectory.txt");
  };
  const std::vector<std::string> exact{"1305031102.175304123", "1305031102.208637456", "1305031102.241970789",
                                       "1305031102.275304000"};
  CHECK(times_of_run(exact) == exact);
  CHECK(times_of_run({"1305031102175304123", "1305031102208637456", "1305031102241970789",
                      "1305031102275304000"}) == exact);
  const std::vector<std::string> tum{"1305031102.175304", "1305031102.211214", "1305031102.243211",
                                     "1305031102.275326"};
  CHECK(times_of_run(tum) == tum);
  const auto read = [&](const std::vector<std::string>& stamps) {
    (void)times_of_run(stamps);
    const auto trajectory = read_trajectory(out.path / "trajectory.txt");
    write_trajectory(out.path / "again.txt", trajectory);
    return test::bytes(out.path / "again.txt") == test::bytes(out.path / "trajectory.txt");
  };
  CHECK(read(exact));
  CHECK(read(tum));
}

TEST_CASE("nanoseconds of a clock go through track() and push()") {
  const test::WalkingSequence sequence(3);
  const Sequence recorded = load_sequence(sequence.path);
  const CameraConfig camera = camera_of(recorded);
  SlamOptions options;
  options.map = false;
  Slam slam(camera, options);
  std::vector<std::int64_t> told;
  LiveOptions live_options;
  live_options.queue = 10;
  live_options.result = [&](const LiveResult& r) { told.push_back(r.ns); };
  LiveSlam live(camera, options, live_options);
  std::chrono::nanoseconds t(1305031102175304123);
  for (const FrameRecord& record : recorded.frames) {
    const RgbdFrame f = decode_frame(record, 0, camera);
    (void)slam.track(f.bgr, f.depth, t);
    live.push(f.bgr, f.depth, t);
    t += std::chrono::nanoseconds(33333333);
  }
  live.finish();
  const std::vector<std::int64_t> expected{1305031102175304123, 1305031102208637456, 1305031102241970789};
  CHECK(told == expected);
  for (Slam* one : {&slam, &live.slam()}) {
    std::vector<std::int64_t> found;
    for (const auto& pose : one->trajectory()) found.push_back(pose.ns);
    CHECK(found == expected);
  }
}
