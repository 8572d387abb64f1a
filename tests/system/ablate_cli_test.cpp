// SPDX-License-Identifier: BSD-3-Clause
// `dynslam ablate` as a user calls it. Sanitizers leave it out: what it runs, they see in the tests of `run`.
#include <doctest/doctest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "program.hpp"
#include "tum_fixture.hpp"

using dynslam::test::call, dynslam::test::ProgramResult;

TEST_CASE("synth and ablate work from end to end and leave the tables and pictures") {
  const dynslam::test::TemporaryFolder folder;
  const std::string path = folder.path.string();
  REQUIRE(call("synth " + path + "/s --frames 45 --path xyz --walkers 1").code == 0);
  const ProgramResult r = call("ablate " + path + "/s --out " + path + "/o");
  CAPTURE(r.out);
  REQUIRE(r.code == 0);
  CHECK(r.out.find("Eq 13") != std::string::npos);
  CHECK(r.out.find("octree") == std::string::npos);  // no chatter of libraries
  for (const char* file :
       {"tables.txt", "tables.md", "ablation.json", "overlays.png", "ate_over_time.png", "map.png",
        "trajectory_none.png", "trajectory_both.png", "both/map.sot", "geometric/masks/1000000.000000.png"}) {
    CAPTURE(file);
    CHECK(std::filesystem::exists(folder.path / "o" / file));
  }
}

TEST_CASE("a model that cannot be loaded is refused before the modes that need none have run") {
  const dynslam::test::TemporaryFolder folder;
  const std::string path = folder.path.string();
  REQUIRE(call("synth " + path + "/s --frames 3 --size 64x64").code == 0);
  std::ofstream(folder.path / "junk.onnx") << "junk";
  const ProgramResult r = call("ablate " + path + "/s --out " + path + "/o --model " + path + "/junk.onnx");
  CAPTURE(r.out);
  CHECK(r.code != 0);
  CHECK(r.out.find("junk.onnx") != std::string::npos);
  CHECK_FALSE(std::filesystem::exists(folder.path / "o" / "none"));
}

TEST_CASE("an ablation without masks runs what it can and says so; a camera at rest does not end it") {
  const dynslam::test::TemporaryFolder folder;
  const std::string path = folder.path.string();
  REQUIRE(call("synth " + path + "/s --frames 10 --path static --scenario empty").code == 0);
  std::filesystem::remove_all(folder.path / "s" / "label");
  const ProgramResult r = call("ablate " + path + "/s --out " + path + "/o --map false");
  CAPTURE(r.out);
  CHECK(r.code == 0);
  CHECK(r.out.find("semantic and both were not run") != std::string::npos);
  CHECK(r.out.find("none: no RPE: ") != std::string::npos);  // too short to have an interval of 1 s
  CHECK(std::filesystem::exists(folder.path / "o" / "geometric" / "trajectory.txt"));
  CHECK_FALSE(std::filesystem::exists(folder.path / "o" / "both"));
  CHECK(std::filesystem::exists(folder.path / "o" / "ablation.json"));
}
