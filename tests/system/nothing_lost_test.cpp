// SPDX-License-Identifier: BSD-3-Clause
// Runs that fail, are stopped or are killed: what was there stays, what was computed is saved.
#include <doctest/doctest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/evaluation/ablate.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "dynslam/runtime/io/map_io.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"
#include "dynslam/runtime/slam/saved_map.hpp"
#include "error_text.hpp"
#include "io/space_reserve.hpp"
#include "office.hpp"
#include "program.hpp"
#include "tum_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;
namespace fs = std::filesystem;
using test::bytes, test::kNeverStop, test::Office, test::office;

namespace {

/// A copy of the office's map in a folder of its own.
struct MapCopy : test::TemporaryFolder {
  fs::path map = path / "map";
  MapCopy() { fs::copy(office().map, map, fs::copy_options::recursive); }
  [[nodiscard]] RunOptions options(std::size_t frames) const {
    RunOptions o = office().options("unused", frames, map, map);
    o.out = path / "out";
    return o;
  }
  [[nodiscard]] std::size_t keyframes() const {
    return load_slam_map(map, office().camera()).keyframes().size();
  }
  /// Every part is there, what was known is known (redundant content may go, files may shrink by it), and
  /// a later session finds it. @return keyframes
  std::size_t check_no_poorer() const {
    for (const char* file : {"keyframes.bin", "scans.bin", "map.sot"}) {
      CAPTURE(file);
      REQUIRE(fs::exists(map / file));
    }
    check_surface_is_known(*load_map(map / "map.sot"));
    // A later session finds itself in it where the first one was, and knows all of it.
    RunOptions again = office().options("unused", 2, map, {});
    again.out = path / "again";
    CHECK(run_sequence(again, kNeverStop).tracked == 2);
    check_surface_is_known(*load_map(again.out / "map.sot"));
    const auto first = read_trajectory(office().folder.path / "first" / "trajectory.txt");
    const auto later = read_trajectory(again.out / "trajectory.txt");
    for (std::size_t i = 0; i < 2; ++i)
      CHECK((first.at(i).T_w_c.translation() - later.at(i).T_w_c.translation()).norm() < 0.01);
    return keyframes();
  }

 private:
  /// What was known is known, what was occupied is occupied, but for a rim's voxels that were seen again.
  static void check_surface_is_known(const interop::SemanticOcTree& now) {
    const auto before = load_map(office().map / "map.sot");
    std::size_t occupied = 0, known = 0, still = 0;
    for (auto leaf = before->begin_leafs(); leaf != before->end_leafs(); ++leaf) {
      if (!before->isNodeOccupied(*leaf)) continue;
      ++occupied;
      const auto* node = now.search(leaf.getCoordinate());
      known += node != nullptr ? 1 : 0;
      still += node != nullptr && now.isNodeOccupied(*node) ? 1 : 0;
    }
    REQUIRE(occupied > 1000);
    CHECK(known == occupied);
    CHECK(static_cast<double>(still) >= 0.95 * static_cast<double>(occupied));
  }
};

nlohmann::json summary_of(const fs::path& out) {
  std::ifstream in(out / "summary.json");
  return nlohmann::json::parse(in);
}

}  // namespace

TEST_CASE("a run that fails at a corrupt mask saves what it has, scans and octree with it") {
  const MapCopy copy;
  const std::size_t before = copy.keyframes();
  const test::TemporaryFolder masks;
  const Sequence sequence = load_sequence(office().sequence);
  for (const FrameRecord& frame : sequence.frames)
    write_image(masks.path / (frame.stamp + ".png"), cv::Mat::zeros(480, 640, CV_8UC1));
  fs::resize_file(masks.path / (sequence.frames[38].stamp + ".png"), 100);
  RunOptions o = copy.options(40);
  o.dynamics = DynamicsMode::semantic;
  o.masks = masks.path;
  CHECK_THROWS_WITH_AS((void)run_sequence(o, kNeverStop), doctest::Contains("is truncated"), InputError);
  CHECK(copy.check_no_poorer() > before);
  CHECK(read_trajectory(o.out / "trajectory.txt").size() == 38);
}

TEST_CASE("a run without an octree takes over the scans and the octree of the map that it loads") {
  const MapCopy copy;
  RunOptions o = copy.options(40);
  o.map = false;
  CHECK(run_sequence(o, kNeverStop).tracked == 40);
  copy.check_no_poorer();
  CHECK(bytes(copy.map / "map.sot") == bytes(office().map / "map.sot"));
}

TEST_CASE("a run whose results have nowhere to go still saves the map whole") {
  const MapCopy copy;
  RunOptions o = copy.options(25);
  const auto lose_the_folder = [&](const Progress& p) {
    if (p.done == 20) fs::remove_all(o.out);
  };
  CHECK_THROWS_AS((void)run_sequence(o, kNeverStop, lose_the_folder), InputError);
  copy.check_no_poorer();
}

TEST_CASE("results inside the folder of the saved map are refused before the run") {
  const MapCopy copy;
  for (const char* out : {"", "results", "deep/er"}) {
    RunOptions o = copy.options(2);
    o.out = copy.map / out;
    CHECK_THROWS_WITH_AS((void)run_sequence(o, kNeverStop),
                         doctest::Contains("lies in the folder of --save-map"), UsageError);
  }
  fs::create_directory_symlink(copy.map, copy.path / "link");
  RunOptions o = copy.options(2);
  o.out = copy.path / "link" / "results";
  CHECK_THROWS_AS((void)run_sequence(o, kNeverStop), UsageError);
  CHECK(std::distance(fs::directory_iterator(copy.map), {}) == 3);
  o = copy.options(2);
  o.out = copy.path;  // around it is well
  o.save_map = copy.path / "map2";
  CHECK(run_sequence(o, kNeverStop).tracked == 2);
}

TEST_CASE("a run that is refused at its start leaves earlier results as they were, and makes no folder") {
  const MapCopy copy;
  const fs::path out = copy.path / "out", junk = copy.path / "junk.onnx";
  const std::vector<std::string> results{"summary.json", "config.toml", "trajectory_map2.txt",
                                         "report.jsonl"};
  fs::create_directories(out);
  for (const std::string& name : results) test::write_file(out / name, "of an earlier run");
  test::write_file(junk, "no network");
  const auto refuse = [&](const std::string& what, const auto& change) {
    CAPTURE(what);
    RunOptions o = office().options("unused", 2, {}, {});
    o.out = out;
    change(o);
    CHECK_THROWS_AS((void)run_sequence(o, kNeverStop), InputError);
    CHECK(std::distance(fs::directory_iterator(out), {}) == 4);
    for (const std::string& name : results) CHECK(bytes(out / name) == "of an earlier run");
    o.out = copy.path / "new";
    CHECK_THROWS_AS((void)run_sequence(o, kNeverStop), InputError);
    CHECK_FALSE(fs::exists(o.out));
  };
  const test::TumFixture other(2);
  refuse("no map", [&](RunOptions& o) { o.load_map = copy.path / "absent"; });
  refuse("map of another camera", [&](RunOptions& o) {
    o.load_map = copy.map;
    o.sequence = other.path;
  });
  refuse("no saved map", [](RunOptions& o) { o.save_map = o.sequence; });
  refuse("no network", [&](RunOptions& o) {
    o.dynamics = DynamicsMode::both;
    o.segmentation.segmenter.model = junk;
  });
  refuse("no network, live", [&](RunOptions& o) {
    o.dynamics = DynamicsMode::both;
    o.segmentation.segmenter.model = junk;
    o.schedule = Schedule::live;
  });
}

TEST_CASE("results never take the place of the map that is loaded, nor of what a sequence links to") {
  const MapCopy copy;
  RunOptions o = copy.options(2);
  o.save_map.clear();
  o.out = copy.map / ".";
  CHECK_THROWS_WITH_AS((void)run_sequence(o, kNeverStop), doctest::Contains("is the folder of --load-map"),
                       UsageError);
  CHECK(std::distance(fs::directory_iterator(copy.map), {}) == 3);
  o.map = false;  // nothing of the map is written
  CHECK(run_sequence(o, kNeverStop).tracked == 2);
  for (const char* file : {"keyframes.bin", "scans.bin", "map.sot"})
    CHECK(bytes(copy.map / file) == bytes(office().map / file));

  const test::TumFixture tum(2);
  const std::string path = tum.path.string(), before = bytes(tum.path / "groundtruth.txt");
  const fs::path truth = tum.path / "groundtruth.txt", result = tum.path / "out" / "trajectory.txt";
  fs::create_directories(tum.path / "out");
  for (const bool found : {true, false}) {  // by an earlier run, and linked to
    fs::rename(found ? truth : result, found ? result : truth);
    fs::create_symlink(found ? result : truth, found ? truth : result);
    test::check_one_line_error("run " + path + " --dynamics none --out " + path + "/out", 2,
                               "groundtruth.txt is read by this run, which would replace it");
    CHECK(bytes(truth) == before);
    CHECK_FALSE(fs::exists(tum.path / "out" / "summary.json"));
    fs::remove(found ? truth : result);
  }
}

TEST_CASE("masks never take the place of what they are made from") {
  const test::TumFixture tum(2);
  const std::string path = tum.path.string();
  const std::string before = bytes(tum.path / "rgb" / "1.000000.png");
  const auto refuse = [&](const std::string& command) {
    test::check_one_line_error(command, 2, "holds images of the sequence");
    CHECK(bytes(tum.path / "rgb" / "1.000000.png") == before);
  };
  refuse("masks " + path + " --camera fr1 --out " + path + "/rgb");
  refuse("mask-faults " + path + " " + path + "/rgb/. --camera fr1 --fault blobs");
  {
    const test::TumFixture in_masks(2);
    const std::string root = in_masks.path.string();
    fs::rename(in_masks.path / "rgb", in_masks.path / "masks");
    fs::create_directory_symlink("masks", in_masks.path / "rgb");
    test::check_one_line_error("run " + root + " --dynamics none --save-masks --out " + root, 2,
                               "masks holds images of the sequence");
    CHECK(bytes(in_masks.path / "masks" / "1.000000.png") == before);
    CHECK_FALSE(fs::exists(in_masks.path / "summary.json"));
  }
  for (const char* folder : {"out", "masks"}) fs::create_directories(tum.path / folder);
  fs::create_directory_symlink(tum.path / "masks", tum.path / "out" / "masks");
  test::check_one_line_error(
      "run " + path + " --masks " + path + "/masks --save-masks --out " + path + "/out", 2,
      "would replace the masks");
  test::write_file(tum.path / "s.toml", "sequences = [\".\"]\nmodes = [\"none\"]\n");
  test::check_one_line_error("sweep " + path + "/s.toml --jobs-to " + path + "/s.toml", 2,
                             "names the sweep itself");
  CHECK(bytes(tum.path / "s.toml").starts_with("sequences"));
}

TEST_CASE("what an earlier run left and this one does not replace is said") {
  const test::WalkingSequence sequence(4);
  const test::TemporaryFolder out;
  RunOptions o = test::options_for(sequence.path, out.path, DynamicsMode::geometric);
  o.save_masks = o.map = true;
  CHECK(run_sequence(o, kNeverStop).warnings.empty());
  CHECK(run_sequence(o, kNeverStop).warnings.empty());
  o.max_frames = 3;
  o.map = false;
  const auto warnings = run_sequence(o, kNeverStop).warnings;
  REQUIRE(warnings.size() == 1);
  CHECK(test::mentions(warnings[0], "still holds map.sot and 1 masks of an earlier run"));
}

TEST_CASE("trajectory and summary are written as the run goes, each whole") {
  const test::TemporaryFolder folder;
  RunOptions o = office().options("unused", 12, {}, {});
  o.out = folder.path / "out";
  o.save_every = 0;
  int seen = 0;
  const auto look = [&](const Progress& p) {
    if (p.done < 3) return;
    // What a kill at this moment would leave; writing takes a twentieth of the time at most.
    if (!fs::exists(o.out / "trajectory.txt")) return;
    const auto poses = read_trajectory(o.out / "trajectory.txt");
    const auto summary = summary_of(o.out);
    CHECK(poses.size() <= p.done);
    CHECK(summary["tracked"] == poses.size());
    CHECK(read_trajectory(o.out / "trajectory_live.txt").size() == poses.size());
    CHECK(summary["interrupted"] == true);
    CHECK(summary["configuration"]["camera"] == "synthetic");
    ++seen;
  };
  CHECK(run_sequence(o, kNeverStop, look).tracked == 12);
  CHECK(seen > 0);
  CHECK(summary_of(o.out)["interrupted"] == false);
  CHECK(read_trajectory(o.out / "trajectory.txt").size() == 12);
  CHECK(read_trajectory(o.out / "trajectory_live.txt").size() == 12);
}

TEST_CASE("a run with most frames broken fails, its results written") {
  const test::TumFixture tum(8);
  fs::create_directories(tum.path / "labels");
  for (const auto& entry : fs::directory_iterator(tum.path / "rgb")) fs::resize_file(entry.path(), 20);
  RunOptions o;
  o.sequence = tum.path;
  o.out = tum.path / "out";
  o.dynamics = DynamicsMode::none;
  o.map = false;
  CHECK_THROWS_WITH_AS(
      (void)run_sequence(o, kNeverStop),
      doctest::Contains("8 of 8 frames are broken, more than the share of 0.5 that --max-broken"),
      InputError);
  CHECK(summary_of(o.out)["broken"] == 8);
  o.max_broken = 1;
  CHECK_THROWS_WITH_AS((void)run_sequence(o, kNeverStop), doctest::Contains("no frame could be tracked"),
                       InputError);
}

TEST_CASE("each mode of an ablation starts from the map given, and saves its own") {
  const MapCopy copy;
  RunOptions o = copy.options(3);
  o.map = false;
  fs::create_directories(copy.path / "truth");
  const Ablation ablation = ablate(o, kNeverStop);
  for (const char* mode : {"none", "semantic", "geometric", "both"}) {
    CAPTURE(mode);
    CHECK(fs::exists(copy.map / mode / "keyframes.bin"));
  }
  for (const char* file : {"keyframes.bin", "scans.bin", "map.sot"})
    CHECK(bytes(copy.map / file) == bytes(office().map / file));
}

TEST_CASE("visiting the same place again and again does not make its map grow") {
  const MapCopy copy;
  std::vector<std::uintmax_t> sizes, keyframes;
  for (int visit = 0; visit < 7; ++visit) {
    CHECK(run_sequence(copy.options(10), kNeverStop).tracked == 10);
    sizes.push_back(fs::file_size(copy.map / "scans.bin"));
    keyframes.push_back(fs::file_size(copy.map / "keyframes.bin"));
  }
  for (const std::uintmax_t size : sizes) CAPTURE(size);
  CHECK(static_cast<double>(sizes.back()) <= 1.1 * static_cast<double>(sizes[2]));
  CHECK(static_cast<double>(keyframes.back()) <= 1.1 * static_cast<double>(keyframes[2]));
  CHECK(sizes.back() >= fs::file_size(office().map / "scans.bin"));
  CHECK(load_map(copy.map / "map.sot")->size() > load_map(office().map / "map.sot")->size() / 2);
}

TEST_CASE("names that are no UTF-8 do not end a run at its end") {
  const test::TemporaryFolder folder;
  RunOptions o = office().options("unused", 2, {}, {});
  o.out = folder.path / "r\xe9sultats";
  o.map = false;
  CHECK(run_sequence(o, kNeverStop).tracked == 2);
  o.load_map = fs::path();
  o.save_map = folder.path / "carte \xff";
  CHECK(run_sequence(o, kNeverStop).tracked == 2);
  CHECK(summary_of(o.out)["frames"] == 2);
}
