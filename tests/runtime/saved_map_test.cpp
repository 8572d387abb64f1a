// SPDX-License-Identifier: BSD-3-Clause
// Maps that are saved, loaded, gone on with, and damaged.
#include "dynslam/runtime/slam/saved_map.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/evaluation/evaluate.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"
#include "dynslam/runtime/io/tum_reader.hpp"
#include "dynslam/runtime/run/run_sequence.hpp"
#include "dynslam/runtime/synth/synth.hpp"
#include "error_text.hpp"
#include "office.hpp"
#include "random.hpp"

using namespace dynslam;
using namespace dynslam::runtime;
namespace fs = std::filesystem;
using test::bytes, test::kNeverStop, test::Office, test::office;

namespace {

std::string complaint(const fs::path& folder) {
  try {
    (void)load_slam_map(folder, office().camera());
  } catch (const InputError& error) {
    return error.what();
  }
  return {};
}

}  // namespace

TEST_CASE("a second session finds itself in the first one's map, in its frame, and extends it") {
  const Office& o = office();
  const fs::path brief = o.folder.path / "brief", extended = o.folder.path / "extended";
  (void)run_sequence(o.options("first_8", 8, {}, brief), kNeverStop);  // of which much is left to be seen
  const RunSummary summary = run_sequence(o.options("second", 40, brief, extended), kNeverStop);
  CHECK(summary.lost == 0);
  CHECK(summary.tracked == 40);
  // The world is the first session's: the same frames have the same poses, without any alignment.
  const auto first = read_trajectory(o.folder.path / "first" / "trajectory.txt");
  const auto second = read_trajectory(o.folder.path / "second" / "trajectory.txt");
  for (std::size_t k = 0; k < first.size(); ++k)
    CHECK((first[k].T_w_c.translation() - second[k].T_w_c.translation()).norm() < 0.01);
  const LocalMap before = load_slam_map(brief, o.camera()), after = load_slam_map(extended, o.camera());
  CHECK(after.keyframes().size() > before.keyframes().size());
  CHECK(after.points().size() > before.points().size());
  CHECK(fs::file_size(extended / "scans.bin") > fs::file_size(brief / "scans.bin"));
  CHECK(bytes(extended / "map.sot").size() > 1000);
  for (const auto& entry : fs::directory_iterator(o.folder.path))
    CHECK(entry.path().extension() != ".partial");
}

TEST_CASE("what is loaded is what was saved") {
  const Office& o = office();
  const LocalMap map = load_slam_map(o.map, o.camera());
  const fs::path again = o.folder.path / "again";
  save_slam_map(map, o.camera(), nullptr, again);
  CHECK(bytes(again / "keyframes.bin") == bytes(o.map / "keyframes.bin"));
  save_slam_map(map, o.camera(), nullptr, again);  // in the place of the one that is there
  CHECK(bytes(again / "keyframes.bin") == bytes(o.map / "keyframes.bin"));
  for (const auto& entry : fs::directory_iterator(o.folder.path)) CHECK(entry.path().extension() != ".old");
}

TEST_CASE("what another run left beside a map is not published with it, nor removed") {
  const Office& o = office();
  const LocalMap map = load_slam_map(o.map, o.camera());
  test::TemporaryFolder folder;
  const fs::path target = folder.path / "map";
  for (const char* name : {"map.partial", "map.old"}) {
    fs::create_directories(folder.path / name);
    test::write_file(folder.path / name / "map.sot", "of a run that was stopped");
    test::write_file(folder.path / name / "scans.bin", "of a run that was stopped");
  }
  check_map_folder(target);
  save_slam_map(map, o.camera(), nullptr, target);  // without an octree
  CHECK(fs::exists(target / "keyframes.bin"));
  CHECK_FALSE(fs::exists(target / "map.sot"));
  CHECK_FALSE(fs::exists(target / "scans.bin"));
  save_slam_map(map, o.camera(), nullptr, target);  // replaces the first
  CHECK(bytes(folder.path / "map.partial" / "map.sot") == "of a run that was stopped");
  CHECK(bytes(folder.path / "map.old" / "map.sot") == "of a run that was stopped");
  CHECK(std::distance(fs::directory_iterator(folder.path), {}) == 3);
}

TEST_CASE("a damaged, foreign or missing map is refused in one line, and nothing of the user's is replaced") {
  const Office& o = office();
  const std::string good = bytes(o.map / "keyframes.bin");
  test::TemporaryFolder folder;
  const fs::path file = folder.path / "keyframes.bin";
  CHECK(complaint(folder.path / "none").find("is not a folder") != std::string::npos);
  CHECK(complaint(folder.path).find("cannot be opened") != std::string::npos);
  test::write_file(file, "something else entirely");
  CHECK(complaint(folder.path).find("is not a dynslam keyframes file") != std::string::npos);
  test::write_file(file, good.substr(0, good.size() / 2));
  CHECK(complaint(folder.path).find("is truncated") != std::string::npos);
  test::write_file(file, good + "x");
  CHECK(complaint(folder.path).find("longer") != std::string::npos);
  std::string other = good;
  other[std::string("dynslam keyframes\n").size()] = 9;
  test::write_file(file, other);
  CHECK(complaint(folder.path).find("has version 9; this program reads version 1") != std::string::npos);
  test::Rng rng("damaged map");
  for (int trial = 0; trial < 30; ++trial) {
    std::string damaged = good;
    const auto at = static_cast<std::size_t>(rng.uniform(0, static_cast<double>(good.size())));
    damaged[at] = static_cast<char>(damaged[at] ^ (1 << rng.integer(0, 7)));
    test::write_file(file, damaged);
    CHECK_FALSE(complaint(folder.path).empty());
    test::write_file(file, good.substr(0, at));
    CHECK_FALSE(complaint(folder.path).empty());
  }
  test::write_file(file, good);
  CHECK(complaint(folder.path).empty());
  CameraConfig camera = o.camera();
  camera.model = PinholeBrownConrady<double>(Pinhole<double>(500, 500, 320, 240), BrownConrady<double>{});
  CHECK_THROWS_WITH_AS((void)load_slam_map(folder.path, camera), doctest::Contains("another camera"),
                       InputError);

  const test::TemporaryFolder precious;
  test::write_file(precious.path / "letter.txt", "dear");
  CHECK_THROWS_WITH_AS(check_map_folder(precious.path), doctest::Contains("would be replaced"), InputError);
  CHECK(bytes(precious.path / "letter.txt") == "dear");
}

TEST_CASE("ids, levels and octaves out of bounds are refused where the check sum fits") {
  const Office& o = office();
  const LocalMap good = load_slam_map(o.map, o.camera());
  const test::TemporaryFolder folder;
  const fs::path target = folder.path / "map";
  const auto complaint_of = [&](auto&& damage) {
    LocalMap map = good;
    damage(map);
    save_slam_map(map, o.camera(), nullptr, target);
    return complaint(target);
  };
  const auto first_good = [](LocalMap& map) -> runtime::MapPoint& {
    return *std::find_if(map.points().begin(), map.points().end(),
                         [](const runtime::MapPoint& p) { return !p.bad; });
  };
  CHECK(complaint_of([](LocalMap&) {}).empty());
  CHECK(test::mentions(complaint_of([](LocalMap& m) { m.keyframe(0).frame.features[3].octave = 8; }),
                       "feature"));
  CHECK(test::mentions(complaint_of([](LocalMap& m) { m.keyframe(0).frame.features[3].x = 1e30F; }),
                       "feature"));
  CHECK(test::mentions(complaint_of([&](LocalMap& m) { first_good(m).reference_octave = 1 << 30; }),
                       "map point"));
  CHECK(test::mentions(complaint_of([&](LocalMap& m) { first_good(m).reference_octave = -1; }), "map point"));
  CHECK(test::mentions(complaint_of([&](LocalMap& m) { first_good(m).patch.level = 8; }), "patch"));
  CHECK(test::mentions(complaint_of([&](LocalMap& m) { first_good(m).keyframes = {1 << 20}; }), "map point"));
}

TEST_CASE("merge chains are followed once each, and circles found") {
  const Office& o = office();
  LocalMap map = load_slam_map(o.map, o.camera());
  const test::TemporaryFolder folder;
  constexpr int kLinks = 200000;  // quadratic: minutes
  const int first = static_cast<int>(map.points().size());
  for (int k = 0; k < kLinks; ++k) {
    runtime::MapPoint p;
    p.bad = true;
    p.merged_into = k + 1 < kLinks ? first + k + 1 : 0;
    map.add_point(p);
  }
  save_slam_map(map, o.camera(), nullptr, folder.path / "chain");
  CHECK(complaint(folder.path / "chain").empty());
  map.point(first + kLinks - 1).merged_into = first + kLinks / 2;
  save_slam_map(map, o.camera(), nullptr, folder.path / "circle");
  CHECK(test::mentions(complaint(folder.path / "circle"), "go in circles"));
}

TEST_CASE("scans of another map are refused, and an octree without its scans") {
  const Office& o = office();
  const test::TemporaryFolder folder;
  const fs::path mixed = folder.path / "mixed";
  // Another saved state of the same room: the keyframes alone differ.
  save_slam_map(
      [&] {
        LocalMap map = load_slam_map(o.map, o.camera());
        map.keyframe(0).frame.index += 1;
        return map;
      }(),
      o.camera(), nullptr, mixed);
  fs::copy_file(o.map / "scans.bin", mixed / "scans.bin");
  RunOptions options = o.options("mixed_out", 2, mixed, {});
  CHECK_THROWS_WITH_AS((void)run_sequence(options, kNeverStop),
                       doctest::Contains("scans.bin: belongs to other keyframes"), InputError);
  fs::remove(mixed / "scans.bin");
  fs::copy_file(o.map / "map.sot", mixed / "map.sot");
  CHECK(test::mentions(complaint(mixed), "not the scans that it was made of"));
}

TEST_CASE(
    "a map of dynslam 0.1.0, whose octree is called map.ot, is gone on with and saved under the new name") {
  const Office& o = office();
  const test::TemporaryFolder folder;
  const fs::path earlier = folder.path / "earlier";
  fs::copy(o.map, earlier);
  fs::rename(earlier / "map.sot", earlier / "map.ot");
  test::write_file(earlier / "letter.txt", "precious");
  const auto run = [&](const char* out, const fs::path& load, const fs::path& save, bool mapping) {
    RunOptions options = o.options(out, 30, load, save);
    options.map = mapping;
    (void)run_sequence(options, kNeverStop);
  };
  // The same bytes as from the map under its new name, saved elsewhere or in the place of the old one.
  run("of_now", o.map, folder.path / "of_now", true);
  run("of_then", earlier, folder.path / "of_then", true);
  CHECK(bytes(folder.path / "of_then" / "map.sot") == bytes(folder.path / "of_now" / "map.sot"));
  CHECK(bytes(folder.path / "of_then" / "scans.bin") == bytes(folder.path / "of_now" / "scans.bin"));
  run("without", earlier, folder.path / "without", false);  // takes the octree over
  CHECK(bytes(folder.path / "without" / "map.sot") == bytes(o.map / "map.sot"));
  run("in_place", earlier, earlier, true);
  CHECK(bytes(earlier / "map.sot") == bytes(folder.path / "of_now" / "map.sot"));
  CHECK_FALSE(fs::exists(earlier / "map.ot"));
  CHECK(bytes(earlier / "letter.txt") == "precious");
  // An octree under either name needs its scans.
  fs::rename(folder.path / "without" / "map.sot", folder.path / "without" / "map.ot");
  fs::remove(folder.path / "without" / "scans.bin");
  CHECK(test::mentions(complaint(folder.path / "without"), "not the scans that it was made of"));
}

TEST_CASE(
    "a run takes the place of the map of an earlier one by dynslam 0.1.0, and of nothing of the user's") {
  const Office& o = office();
  const fs::path out = o.folder.path / "over_earlier";
  fs::create_directories(out);
  fs::copy_file(o.map / "map.sot", out / "map.ot");
  (void)run_sequence(o.options("over_earlier", 3, {}, {}), kNeverStop);
  CHECK(fs::exists(out / "map.sot"));
  CHECK_FALSE(fs::exists(out / "map.ot"));
  fs::copy_file(out / "map_color.ot", out / "map.ot");  // a ColorOcTree, as OctoMap's programs want it
  (void)run_sequence(o.options("over_earlier", 3, {}, {}), kNeverStop);
  CHECK(bytes(out / "map.ot") == bytes(out / "map_color.ot"));
}

TEST_CASE("a scan of a keyframe that the map has not is refused") {
  const Office& o = office();
  std::uint64_t id = 0;
  const LocalMap map = load_slam_map(o.map, o.camera(), &id);
  SemanticMapper mapper(o.camera().model, o.camera().width, o.camera().height, {});
  const int keyframes = static_cast<int>(map.keyframes().size());
  CHECK_THROWS_WITH_AS((void)mapper.load_scans(o.map / "scans.bin", {id, keyframes - 1}),
                       doctest::Contains("not in the map"), InputError);
  CHECK(mapper.load_scans(o.map / "scans.bin", {id, keyframes}).size() == map.keyframes().size());
}

TEST_CASE("who never finds himself in a map is told so") {
  const Office& o = office();
  const test::TemporaryFolder elsewhere;
  SynthOptions synth;
  synth.frames = 3;
  synth.seed = 7;
  synth.scenario = "empty";
  synthesize(synth, elsewhere.path);
  RunOptions options = o.options("lost", 0, o.map, {});
  options.sequence = elsewhere.path;
  CHECK_THROWS_WITH_AS((void)run_sequence(options, kNeverStop), doctest::Contains("never found itself"),
                       InputError);
}
