// SPDX-License-Identifier: BSD-3-Clause
// What the system says of itself beside each frame's result.
#include "dynslam/runtime/slam/slam_events.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <stdexcept>
#include <string>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/frame_stream.hpp"
#include "dynslam/runtime/slam.hpp"
#include "run_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

constexpr int kToldFrames = 36;

/// Rendered once for all tests of this file.
struct ToldWalk {
  test::WalkingSequence folder{kToldFrames};
  CameraConfig camera;
  std::vector<RgbdFrame> frames;

  ToldWalk() {
    const Sequence sequence = load_sequence(folder.path);
    camera = load_camera(sequence.camera_hint);
    for (std::size_t i = 0; i < sequence.frames.size(); ++i)
      frames.push_back(decode_frame(sequence.frames[i], i, camera));
  }
  /// A frame, black from `from` until before `to`.
  [[nodiscard]] RgbdFrame covered(std::size_t i, std::size_t from, std::size_t to) const {
    RgbdFrame frame = frames[i];
    if (i < from || i >= to) return frame;
    frame.bgr =
        cv::Mat(frame.bgr.size(), frame.bgr.type(), cv::Scalar());  // not the image that was copied from
    frame.gray = cv::Mat(frame.gray.size(), frame.gray.type(), cv::Scalar());
    return frame;
  }
};

const ToldWalk& told_walk() {
  static const ToldWalk made;
  return made;
}

/// One line per event, in order.
struct Log {
  std::vector<std::string> lines;
  [[nodiscard]] std::vector<std::string> of(const std::string& kind) const {
    std::vector<std::string> result;
    std::copy_if(lines.begin(), lines.end(), std::back_inserter(result),
                 [&](const std::string& line) { return line.starts_with(kind); });
    return result;
  }
  [[nodiscard]] SlamEvents events() {
    SlamEvents e;
    const auto at = [](double t) { return std::string(" ").append(std::to_string(t)); };
    e.keyframe = [this, at](const KeyframeEvent& k) {
      lines.push_back("keyframe" + at(k.t) + " " + std::to_string(k.id));
    };
    e.loop = [this, at](const LoopEvent& l) { lines.push_back("loop" + at(l.t)); };
    e.adjusted = [this, at](const AdjustedEvent& a) {
      lines.push_back("adjusted" + at(a.t) + " " + std::to_string(a.newest));
    };
    e.lost = [this, at](const LostEvent& l) { lines.push_back("lost" + at(l.t)); };
    e.found = [this, at](const FoundEvent& f) {
      lines.push_back("found" + at(f.t) + " " + std::to_string(f.frames));
    };
    return e;
  }
};

SlamOptions without_map(const SlamEvents& events = {}) {
  SlamOptions options;
  options.map = false;
  options.events = events;
  return options;
}

}  // namespace

TEST_CASE("keyframes, adjustments, a loss and its end are told in order, and the same in every run") {
  constexpr std::size_t kFrom = 14, kTo = 24;  // black
  const auto run = [&](Log& log) {
    Slam slam(told_walk().camera, without_map(log.events()));
    std::vector<TrackResult> results;
    for (std::size_t i = 0; i < told_walk().frames.size(); ++i)
      results.push_back(slam.track(told_walk().covered(i, kFrom, kTo)));
    slam.finish();
    const auto keyframes = log.of("keyframe");
    std::vector<std::string> expected;  // of a place that is known the map notes the pose alone, culled
    for (const auto& k : slam.map().keyframes()) {
      if (!k.culled())
        expected.push_back("keyframe " + std::to_string(k.frame.t) + " " + std::to_string(k.id));
    }
    CHECK(keyframes == expected);
    return results;
  };
  Log log;
  const std::vector<TrackResult> results = run(log);
  const auto lost_at = std::find_if(results.begin(), results.end(),
                                    [](const auto& r) { return r.state == TrackingState::lost; });
  const auto found_at = std::find_if(lost_at, results.end(), [](const auto& r) { return r.ok(); });
  REQUIRE(found_at != results.end());
  const auto stamp = [&](const auto& it) {
    return std::to_string(told_walk().frames[static_cast<std::size_t>(it - results.begin())].t);
  };
  CHECK(lost_at - results.begin() == kFrom);
  REQUIRE(log.of("lost") == std::vector<std::string>{"lost " + stamp(lost_at)});
  REQUIRE(log.of("found") ==
          std::vector<std::string>{"found " + stamp(found_at) + " " + std::to_string(found_at - lost_at)});
  CHECK(log.lines.front().starts_with("keyframe"));
  CHECK(log.of("keyframe").size() > 2);
  // All but the first one and that of the frame before the loss, to which none could be added in time.
  CHECK(log.of("adjusted").size() >= log.of("keyframe").size() - 2);
  // A keyframe's time is its frame's, which is the one before where the camera was about to be lost.
  const auto sorted = [&](bool keyframes) {
    std::vector<std::string> times;
    for (const std::string& line : log.lines)
      if (line.starts_with("keyframe") == keyframes) times.push_back(line.substr(line.find(' ') + 1, 14));
    return std::is_sorted(times.begin(), times.end());
  };
  CHECK(sorted(true));
  CHECK(sorted(false));
  Log again;
  (void)run(again);
  CHECK(again.lines == log.lines);
}

TEST_CASE("in a map that was loaded the first pose is told as found") {
  const test::TemporaryFolder folder;
  Slam first(told_walk().camera, without_map());
  for (std::size_t i = 0; i < 12; ++i) (void)first.track(told_walk().frames[i]);
  first.save(folder.path / "map");
  Log log;
  Slam second(told_walk().camera, without_map(log.events()));
  second.load(folder.path / "map");
  CHECK(log.lines.empty());
  RgbdFrame black = told_walk().covered(2, 0, 5);
  CHECK_FALSE(second.track(black).ok());
  CHECK(log.of("lost").size() == 1);
  CHECK(second.track(told_walk().frames[5]).ok());
  REQUIRE(log.of("found").size() == 1);
  CHECK(log.of("found")[0].ends_with(" 1"));
}

TEST_CASE("a function that throws costs its frame's result alone; what may not be called is refused") {
  Log log;
  SlamEvents events = log.events();
  const auto keep = events.keyframe;
  bool thrown = false;
  events.keyframe = [&](const KeyframeEvent& k) {
    if (k.id == 1 && !std::exchange(thrown, true)) throw std::runtime_error("the map's window is closed");
    keep(k);
  };
  Slam slam(told_walk().camera, without_map(events));
  int refused = 0;
  for (const RgbdFrame& frame : told_walk().frames) {
    try {
      (void)slam.track(frame);
    } catch (const std::runtime_error& error) {
      ++refused;
      CHECK(std::string(error.what()) == "the map's window is closed");
    }
  }
  slam.finish();
  CHECK(refused == 1);
  CHECK(slam.whole());
  CHECK(slam.trajectory().size() == told_walk().frames.size());
  CHECK(log.of("keyframe").size() == slam.map().keyframes().size() - 1);  // all but the one that was refused

  Slam* inside = nullptr;
  SlamEvents wrong;
  wrong.keyframe = [&](const KeyframeEvent&) {
    CHECK_THROWS_WITH_AS(inside->reset(), doctest::Contains("Slam::reset() must not be called"), UsageError);
    CHECK_THROWS_AS(inside->finish(), UsageError);
    CHECK_THROWS_AS((void)inside->track(told_walk().frames[1]), UsageError);
    CHECK_THROWS_AS(inside->load("nowhere"), UsageError);
    CHECK(inside->trajectory().size() == 1);
  };
  Slam other(told_walk().camera, without_map(wrong));
  inside = &other;
  CHECK(other.track(told_walk().frames[0]).ok());
}
