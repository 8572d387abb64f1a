// SPDX-License-Identifier: BSD-3-Clause
// A camera that is covered, carried away and comes back: nothing of what it saw is lost.
#include <doctest/doctest.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "dynslam/eval/trajectory.hpp"
#include "dynslam/runtime/io/frame_stream.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"
#include "dynslam/runtime/run/run_sequence.hpp"
#include "dynslam/runtime/slam.hpp"
#include "dynslam/runtime/slam/frame_preparation.hpp"
#include "run_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

/// Once around in an office, 20 degrees per second. Rendered once for all tests of this file.
struct RoundTrip {
  static constexpr int kFrames = 200;  // 400 degrees
  test::TemporaryFolder folder;
  CameraConfig camera;
  std::vector<RgbdFrame> frames;
  std::vector<StampedPose<double>> truth;

  RoundTrip() {
    SynthOptions options;
    options.frames = kFrames;
    options.path = "loop";
    options.scenario = "empty";
    options.fps = 10;
    options.blackout_from = 20;
    options.blackout_frames = 105;
    synthesize(options, folder.path);
    const Sequence sequence = load_sequence(folder.path);
    camera = camera_of(sequence);
    truth = sequence.groundtruth;
    FramePreparation prepare({});
    for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
      if (i >= 20 && i < 125) continue;  // black: the camera is carried in a bag
      frames.push_back(decode_frame(sequence.frames[i], i, camera));
      prepare(frames.back());
    }
  }
  [[nodiscard]] RgbdFrame black(double t) const {
    RgbdFrame frame = frames.front();
    frame.t = t;
    frame.stamp.clear();
    frame.bgr =
        cv::Mat(frame.bgr.size(), frame.bgr.type(), cv::Scalar());  // not the image that was copied from
    frame.gray = cv::Mat(frame.gray.size(), frame.gray.type(), cv::Scalar());
    frame.features.reset();
    return frame;
  }
};

const RoundTrip& round_trip() {
  static const RoundTrip made;
  return made;
}

constexpr std::size_t kBefore = 20;  // frames until the camera is covered

/// What became of the frames.
struct Trip {
  std::unique_ptr<Slam> slam;
  std::vector<TrackResult> results;
  std::vector<std::string> told;
};

Trip travel(SlamOptions options, std::size_t frames) {
  Trip trip;
  options.events.map_begun = [&](const MapBegunEvent& e) {
    trip.told.push_back("begun " + std::to_string(e.map));
  };
  options.events.map_joined = [&](const MapJoinedEvent& e) {
    trip.told.push_back("joined " + std::to_string(e.map) + " " + std::to_string(e.frames));
  };
  trip.slam = std::make_unique<Slam>(round_trip().camera, options);
  for (std::size_t i = 0; i < std::min(frames, round_trip().frames.size()); ++i) {
    if (i == kBefore) {
      for (double dark = 0.5; dark < 10; dark += 0.5)
        CHECK_FALSE(trip.slam->track(round_trip().black(round_trip().frames[i - 1].t + dark)).ok());
    }
    trip.results.push_back(trip.slam->track(round_trip().frames[i]));
  }
  trip.slam->finish();
  return trip;
}

SlamOptions all_static() {
  SlamOptions options;
  options.dynamics = DynamicsMode::none;
  options.map_resolution = 0.1;
  options.mapper.scan.max_range = 4;  // else what lies beyond a hole is seen from its rims
  return options;
}

}  // namespace

TEST_CASE("what is seen while the camera is lost joins the map when the place is recognised") {
  const Trip trip = travel(all_static(), 1000);
  const std::size_t all = round_trip().frames.size();
  std::size_t separate = 0;
  for (const TrackResult& r : trip.results) separate += r.separate ? 1 : 0;
  CHECK(separate > 25);
  CHECK(trip.results.back().ok());
  REQUIRE(trip.told.size() == 2);
  CHECK(trip.told[0] == "begun 2");
  CHECK(trip.told[1] == "joined 2 " + std::to_string(separate));
  CHECK(trip.slam->separate_trajectories().empty());

  const auto trajectory = trip.slam->trajectory();
  CHECK(trajectory.size() == all);
  CHECK(std::is_sorted(trajectory.begin(), trajectory.end(),
                       [](const auto& a, const auto& b) { return a.t < b.t; }));
  const auto ate = absolute_trajectory_error<double>(trajectory, round_trip().truth);
  REQUIRE(ate);
  MESSAGE("ATE of the joined trajectory: ", ate->translation.rmse, " m");
  CHECK(ate->translation.rmse < 0.02);
  CHECK(ate->translation.max < 0.05);

  // As the frames came: one that only the new map knew had no pose in the world of the others.
  const auto& live = trip.slam->live_trajectory();
  CHECK(live.size() + separate == all);
  for (const StampedPose<double>& pose : live) {
    const auto truth = std::find_if(round_trip().truth.begin(), round_trip().truth.end(),
                                    [&](const auto& t) { return t.t == pose.t; });
    REQUIRE(truth != round_trip().truth.end());
    const SE3<double> T_first = round_trip().truth.front().T_w_c.inverse() * truth->T_w_c;
    CHECK((T_first.translation() - pose.T_w_c.translation()).norm() < 0.1);  // drift, but no other world
  }

  // The octree has what was seen meanwhile; without a new map there is a hole.
  SlamOptions waiting = all_static();
  waiting.new_map.begin = false;
  const Trip hole = travel(waiting, 1000);
  CHECK(hole.told.empty());
  CHECK(hole.slam->trajectory().size() + separate == all);
  CHECK(trip.slam->octree()->size() > 1.2 * static_cast<double>(hole.slam->octree()->size()));
  CHECK(trip.slam->map().keyframes().size() > hole.slam->map().keyframes().size() + 5);

  const Trip again = travel(all_static(), 1000);
  CHECK(again.told == trip.told);
  const auto same = again.slam->trajectory();
  REQUIRE(same.size() == trajectory.size());
  for (std::size_t i = 0; i < same.size(); ++i) CHECK(same[i].T_w_c.matrix() == trajectory[i].T_w_c.matrix());
}

TEST_CASE("a map whose place is never recognised stays beside, with a trajectory of its own") {
  SlamOptions as_tracked = all_static();  // smoothing moves the first pose with the others
  as_tracked.trajectory.smooth = false;
  const Trip trip = travel(as_tracked, kBefore + 30);  // it never comes back
  CHECK(trip.told == std::vector<std::string>{"begun 2"});
  CHECK(trip.slam->trajectory().size() == kBefore);
  const auto separate = trip.slam->separate_trajectories();
  REQUIRE(separate.size() == 1);
  CHECK(separate[0].map == 2);
  REQUIRE(separate[0].poses.size() == 30);
  CHECK(separate[0].poses.front().T_w_c.translation().norm() < 1e-9);  // its own world
  const auto ate = absolute_trajectory_error<double>(separate[0].poses, round_trip().truth);
  REQUIRE(ate);
  CHECK(ate->translation.max < 0.02);

  // It is saved beside the main map, as often as one likes, and found again; what was there stays.
  const test::TemporaryFolder saved;
  const std::filesystem::path map = saved.path / "map", earlier = saved.path / "earlier";
  for (int twice = 0; twice < 2; ++twice) trip.slam->save(map);
  CHECK_FALSE(std::filesystem::exists(map / "map3"));
  std::filesystem::create_directories(earlier / "map2");
  std::filesystem::copy(map / "keyframes.bin", earlier / "keyframes.bin");
  trip.slam->save(earlier);
  CHECK(std::filesystem::is_empty(earlier / "map2"));
  CHECK(std::filesystem::exists(earlier / "map3" / "keyframes.bin"));
  Slam later(round_trip().camera, all_static());
  later.load(map / "map2");
  const TrackResult back = later.track(round_trip().frames[kBefore + 5]);
  REQUIRE(back.ok());
  CHECK((back.T_w_c.inverse() * separate[0].poses[5].T_w_c).log().norm() < 0.01);
  later.finish();
  CHECK(later.octree()->size() > trip.slam->octree()->size() / 4);

  trip.slam->reset();
  CHECK(trip.slam->separate_trajectories().empty());
}

TEST_CASE("a run counts what was joined as tracked, and writes what was not beside its trajectory") {
  const test::TemporaryFolder out;
  RunOptions o;
  o.sequence = round_trip().folder.path;
  o.out = out.path;
  o.dynamics = DynamicsMode::none;
  o.map = false;
  o.max_frames = 150;  // it never comes back
  const std::filesystem::path beside = out.path / "trajectory_map2.txt";
  const RunSummary separate = run_sequence(o, test::kNeverStop);
  CHECK(separate.tracked == kBefore);
  CHECK(separate.lost == 130);
  REQUIRE(separate.separate.size() == 1);
  CHECK(read_trajectory(beside).size() == 25);
  CHECK(read_trajectory(out.path / "trajectory.txt").size() == kBefore);
  const auto json = nlohmann::json::parse(test::bytes(out.path / "summary.json"));
  CHECK(json["separate_maps"] == nlohmann::json::parse(R"([{"map": 2, "frames": 25}])"));

  o.max_frames = 0;
  const RunSummary joined = run_sequence(o, test::kNeverStop);
  CHECK(joined.tracked == 95);
  CHECK(joined.lost == 105);
  CHECK(joined.separate.empty());
  CHECK(separate.problems.size() == 130);
  CHECK(joined.problems.size() == 105);
  CHECK(std::stod(joined.problems.back()) < round_trip().frames[kBefore].t);
  CHECK(read_trajectory(out.path / "trajectory.txt").size() == 95);
  CHECK(read_trajectory(out.path / "trajectory_live.txt").size() == joined.live_trajectory.size());
  CHECK(joined.live_trajectory.size() < 95 - 25);  // of the new map's frames none
  CHECK_FALSE(std::filesystem::exists(beside));
}
