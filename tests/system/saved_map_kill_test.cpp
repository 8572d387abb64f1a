// SPDX-License-Identifier: BSD-3-Clause
// A save is killed before every system call that it makes: the folder holds the old map or the new one.
#include <doctest/doctest.h>

#include <array>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>

#include "dynslam/runtime/io/atomic_file.hpp"
#include "dynslam/runtime/slam/saved_map.hpp"
#include "killed_child.hpp"
#include "run_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;
namespace fs = std::filesystem;
using test::bytes, test::Child;

namespace {

constexpr std::array<const char*, 3> kFiles{"keyframes.bin", "scans.bin", "map.sot"};

/// Two maps of one keyframe, small enough to be saved hundreds of times.
struct TwoMaps {
  CameraConfig camera = load_camera("fr3");
  LocalMap first, second;
  std::unique_ptr<SemanticMapper> mapper;
  TwoMaps() {
    camera.width = camera.height = 64;
    mapper = std::make_unique<SemanticMapper>(camera.model, 64, 64, SemanticMapperOptions{});
    mapper->insert({SE3<double>(), cv::Mat(64, 64, CV_32FC1, cv::Scalar(1.5)), cv::Mat(), cv::Mat(),
                    cv::Mat::zeros(64, 64, CV_8UC3), 0});
    mapper->finish();
    runtime::Frame frame;
    frame.t = 1;
    first.add_keyframe(frame);
    frame.t = 2;
    second.add_keyframe(frame);
  }
};

/// What a folder holds, byte for byte; "" where a file is missing.
std::string content_of(const fs::path& folder) {
  std::string all;
  for (const char* file : kFiles) {
    if (!fs::exists(folder / file)) return {};
    all += bytes(folder / file);
  }
  return all;
}

struct Tally {
  int kills = 0, old_map = 0, new_map = 0;
};

/// @param exchange  whether the file system can exchange two folders
std::optional<Tally> kill_at_every_call(const TwoMaps& maps, bool exchange) {
  const test::TemporaryFolder folder;
  const fs::path target = folder.path / "m";
  const auto save = [&](const LocalMap& map) { save_slam_map(map, maps.camera, maps.mapper.get(), target); };
  save(maps.second);
  const std::string after = content_of(target);
  const auto reset = [&] {
    save(maps.first);
    write_file(target / "letter.txt", "dear");
    fs::create_directories(target / "photos");
    write_file(target / "photos" / "a.jpg", "picture");
  };
  reset();
  const std::string before = content_of(target);
  REQUIRE(before != after);
  Tally tally;
  for (int call = 1;; ++call) {
    const Child child = test::run_and_kill(call, [&] {
      if (!exchange && !test::forbid_exchange()) ::_exit(77);
      save(maps.second);
    });
    if (child == Child::untraceable) return std::nullopt;
    REQUIRE(child != Child::failed);
    CAPTURE(call);
    // With a file system that exchanges, there is always a folder; without, loading puts it back.
    if (exchange) CHECK(fs::exists(target / "keyframes.bin"));
    if (exchange) CHECK(bytes(target / "letter.txt") == "dear");
    CHECK(load_slam_map(target, maps.camera).keyframes().size() == 1);
    const std::string found = content_of(target);
    const bool is_new = found == after;
    CHECK((is_new || found == before));
    if (child == Child::done) {
      CHECK(is_new);
      CHECK(bytes(target / "photos" / "a.jpg") == "picture");
      CHECK(std::distance(fs::directory_iterator(folder.path), {}) == 1);  // every earlier draft is gone
      return tally;
    }
    ++tally.kills;
    (is_new ? tally.new_map : tally.old_map) += 1;
    if (is_new) reset();
    CHECK(bytes(target / "letter.txt") == "dear");
    check_map_folder(target);
  }
}

}  // namespace

TEST_CASE(
    "a save killed before any of its system calls leaves the old map or the new one, and the user's files") {
  const TwoMaps maps;
  for (const bool exchange : {true, false}) {
    CAPTURE(exchange);
    const auto tally = kill_at_every_call(maps, exchange);
    if (!tally) {
      MESSAGE("skipped: this system does not let a process be traced");
      return;
    }
    MESSAGE(std::string(exchange ? "with" : "without"), " exchange: killed at ", tally->kills,
            " calls: ", tally->old_map, " left the old map, ", tally->new_map, " the new one");
    CHECK(tally->kills > 50);
    CHECK(tally->old_map > 10);
    CHECK(tally->new_map > 0);
  }
}
