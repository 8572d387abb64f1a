// SPDX-License-Identifier: BSD-3-Clause
// The configuration file as a user of the program meets it.
#include <doctest/doctest.h>

#include <fstream>
#include <string>

#include "error_text.hpp"
#include "program.hpp"
#include "run_fixture.hpp"
#include "small_sequence.hpp"

using namespace dynslam;
using namespace dynslam::runtime;
using test::bytes, test::call, test::mentions;

TEST_CASE("dynslam config prints a file that it reads as the same, with options and tables of a file") {
  const test::TemporaryFolder folder;
  const std::string path = folder.path.string(), file = path + "/c.toml", other = path + "/d.toml";
  REQUIRE(test::shell(std::string(DYNSLAM_PROGRAM) + " config > " + file).code == 0);
  CHECK(call("config " + file).out == bytes(file));
  CHECK_FALSE(mentions(bytes(file), "min_inliers"));
  REQUIRE(test::shell(std::string(DYNSLAM_PROGRAM) + " config --tuning > " + other).code == 0);
  CHECK(mentions(bytes(other), "no promise"));
  CHECK(mentions(bytes(other), "\nmin_inliers = 25\n"));
  CHECK(call("config " + other).out == bytes(file));  // all of them have their defaults
  std::ofstream(other) << "[run]\nmax-frames = 3\nsave-masks = true\nfeatures = 600\ndynamics = none\n"
                          "[tracker.features]\nfeatures = 700\nlevels = 6\n[eval]\njson = true\n";
  const test::ProgramResult shown = call("config " + other);
  CHECK(shown.code == 0);
  for (const char* line : {"\nmax_frames = 3\n", "\nsave_masks = true\n", "\nfeatures = 600\n",
                           "\nlevels = 6\n", "\ndynamics = \"none\"\n"})
    CHECK(mentions(shown.out, line));
  CHECK(mentions(call("config --tuning " + other).out, "\nlevels = 6\n"));
  CHECK(mentions(call("eval --config " + other + " " + file + " " + file).out, "c.toml:3: expected 8"));

  std::ofstream(other) << "[tracker.pose]\nnu = 5\nnnu = 5\n";
  std::ofstream(folder.path / "nul.toml") << "masks = \"a\\u0000b\"\n";  // no field, but an option
  test::check_one_line_error("run " + path + " --config " + path + "/nul.toml", 1,
                             "nul.toml:1: masks has a NUL character");
  const std::string error =
      "dynslam: error: " + other + ":3: unknown key 'nnu' in [tracker.pose], did you mean nu?\n";
  for (const std::string& command : {"config " + other, "run " + path + " --config " + other,
                                     "ablate --config " + other + " " + path, "eval a b --config " + other}) {
    const test::ProgramResult r = call(command);
    CHECK(r.code == 1);
    CHECK(r.out == error);
  }
}

TEST_CASE(
    "a run from its own config.toml gives the same bytes, and one changed field changes what it should") {
  const test::WalkingSequence sequence(12);
  const test::TemporaryFolder folder;
  const auto run = [&](const std::string& name, const std::string& arguments) {
    const test::ProgramResult r =
        call("run " + sequence.path.string() + " --out " + (folder.path / name).string() + " " + arguments);
    CAPTURE(r.out);
    REQUIRE(r.code == 0);
    return folder.path / name;
  };
  const auto written = folder.path / "c.toml";
  std::ofstream(written) << "[run]\nseed = 5\n[tracker.features]\nfeatures = 700\n[mapper.scan]\n"
                            "pixel_stride = 3\n[tracker.search]\nprior_speed = 0.7\n";
  const auto first = run("first", "--nu 4.3 --config " + written.string());
  const std::string config = bytes(first / "config.toml");
  for (const char* line : {"\nseed = 5\n", "\nfeatures = 700\n", "\npixel_stride = 3\n", "\nnu = 4.3\n",
                           "\ndynamics = \"geometric\"\n"})
    CHECK(mentions(config, line));

  const auto again = run("again", "--config " + (first / "config.toml").string());
  for (const char* file :
       {"trajectory.txt", "trajectory_live.txt", "keyframes.txt", "map.sot", "config.toml"}) {
    CAPTURE(file);
    CHECK(bytes(again / file) == bytes(first / file));
  }
  const auto changed = [&](const std::string& name, const std::string& from, const std::string& to) {
    std::string text = config;
    const auto at = text.find(from);
    REQUIRE(at != std::string::npos);
    std::ofstream(written) << text.replace(at, from.size(), to);
    return run(name, "--config " + written.string());
  };
  const auto map = changed("map", "\npixel_stride = 3\n", "\npixel_stride = 4\n");
  CHECK(bytes(map / "trajectory.txt") == bytes(first / "trajectory.txt"));
  CHECK(bytes(map / "map.sot") != bytes(first / "map.sot"));
  const auto features = changed("features", "\nfeatures = 700\n", "\nfeatures = 400\n");
  CHECK(bytes(features / "trajectory.txt") != bytes(first / "trajectory.txt"));
  const auto command_line = run("line", "--features 400 --config " + (first / "config.toml").string());
  CHECK(bytes(command_line / "trajectory.txt") == bytes(features / "trajectory.txt"));
}

TEST_CASE("a run replaces its --config by the same bytes alone") {
  const test::TemporaryFolder folder;
  const std::string run = "run " + test::small_original().string() + " --out " + folder.path.string(),
                    own = "# mine\n[general]\nseed = 3\n";
  const auto config = folder.path / "config.toml";
  const std::string again = " --config " + config.string();
  test::write_file(config, own);
  test::check_one_line_error(run + again, 2,
                             "config.toml would be replaced by the configuration of this run");
  CHECK(bytes(config) == own);
  std::filesystem::create_directories(folder.path / "both");
  test::write_file(folder.path / "both" / "config.toml", own);
  test::check_one_line_error(
      "ablate" + run.substr(3) + " --config " + (folder.path / "both").string() + "/config.toml", 2,
      "would be replaced");

  REQUIRE(call(run + " --dynamics none --no-map --seed 3").code == 0);
  const std::string written = bytes(config);
  CHECK(call(run + again).code == 0);  // the same run again
  CHECK(bytes(config) == written);
  test::check_one_line_error(run + again + " --seed 4", 2, "would be replaced");
  CHECK(bytes(config) == written);
}
