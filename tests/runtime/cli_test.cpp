// SPDX-License-Identifier: BSD-3-Clause
// The program as a user calls it: exit codes, one-line errors, JSON, config files.
#include <doctest/doctest.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "tum_fixture.hpp"

#ifdef DYNSLAM_PROGRAM
namespace {

struct Result {
  int code;
  std::string out;  ///< stdout and stderr
};

Result call(const std::string& arguments) {
  const std::string command = std::string(DYNSLAM_PROGRAM) + " " + arguments + " 2>&1";
  FILE* pipe = popen(command.c_str(), "r");
  REQUIRE(pipe != nullptr);
  Result result;
  std::array<char, 4096> buffer;
  while (const std::size_t n = fread(buffer.data(), 1, buffer.size(), pipe)) result.out.append(buffer.data(), n);
  result.code = WEXITSTATUS(pclose(pipe));
  return result;
}

void check_one_line_error(const std::string& arguments, int code, const std::string& part) {
  const Result r = call(arguments);
  CAPTURE(arguments);
  CAPTURE(r.out);
  CHECK(r.code == code);
  CHECK(r.out.rfind("dynslam: error: ", 0) == 0);
  CHECK(std::count(r.out.begin(), r.out.end(), '\n') == 1);
  CHECK(r.out.find(part) != std::string::npos);
}

}  // namespace

TEST_CASE("help and version succeed everywhere") {
  CHECK(call("--version").out.rfind("dynslam 0.", 0) == 0);
  for (const char* command : {"", "run", "eval", "eval-masks", "ablate", "synth"}) {
    const Result r = call(std::string(command) + " --help");
    CHECK(r.code == 0);
    CHECK(r.out.find("--help") != std::string::npos);
  }
}

TEST_CASE("errors are one line on stderr with a non-zero code") {
  const dynslam::test::TumFixture tum(3);
  const std::string path = tum.path.string();
  check_one_line_error("", 2, "subcommand");
  check_one_line_error("run " + path + " --out " + path + "/o --dynamics magic", 2, "magic");
  check_one_line_error("run " + path + "/absent --out " + path + "/o --dynamics none", 1, "is not a folder");
  check_one_line_error("run " + path + " --out " + path + "/o --dynamics both", 2, "--masks");
  check_one_line_error("run " + path + " --out " + path + "/o --dynamics none --camera fr7", 2, "unknown camera 'fr7'");
  check_one_line_error("run " + path + " --out /proc/no --dynamics none", 1, "/proc/no");
  check_one_line_error("eval " + path + "/groundtruth.txt " + path + "/rgb.txt", 1, "rgb.txt:1: expected 8 columns");
  check_one_line_error("eval " + path + "/groundtruth.txt " + path + "/groundtruth.txt", 1, "cannot be aligned");
  check_one_line_error("eval-masks " + path + " " + path + "/absent", 1, "is not a folder");
  check_one_line_error("synth " + path + "/s --scenario party", 2, "unknown scenario 'party'");
}

TEST_CASE("a sequence without anything to track ends with an error, and its files are there") {
  const dynslam::test::TumFixture tum(3);
  const Result r = call("run " + tum.path.string() + " --out " + (tum.path / "o").string() + " --dynamics none");
  CHECK(r.code == 1);
  CHECK(r.out.find("no frame could be tracked") != std::string::npos);
  CHECK(std::filesystem::exists(tum.path / "o" / "summary.json"));
}

TEST_CASE("eval prints the documented JSON, from options of a config file too") {
  const dynslam::test::TemporaryFolder folder;
  const std::string gt = (folder.path / "gt.txt").string(), config = (folder.path / "c.toml").string();
  {
    std::ofstream out(gt);
    for (int i = 0; i < 90; ++i) out << i / 30.0 << ' ' << std::sin(0.1 * i) << ' ' << std::cos(0.1 * i) << ' ' << 0.01 * i << " 0 0 0 1\n";
    std::ofstream(config) << "[eval]\njson = true\n";
  }
  for (const std::string& arguments : {"eval " + gt + " " + gt + " --json", "eval --config " + config + " " + gt + " " + gt}) {
    const Result r = call(arguments);
    CAPTURE(r.out);
    REQUIRE(r.code == 0);
    const auto json = nlohmann::json::parse(r.out);
    CHECK(json["pairs"] == 90);
    for (const char* part : {"ate_m", "rpe_trans_m", "rpe_rot_deg"}) {
      for (const char* figure : {"rmse", "mean", "median", "std", "min", "max"}) CHECK(json[part][figure].get<double>() < 1e-6);
    }
  }
}

TEST_CASE("synth and ablate work from end to end and leave the tables and pictures") {
  const dynslam::test::TemporaryFolder folder;
  const std::string path = folder.path.string();
  REQUIRE(call("synth " + path + "/s --frames 45 --path xyz --walkers 1").code == 0);
  const Result r = call("ablate " + path + "/s --out " + path + "/o");
  CAPTURE(r.out);
  REQUIRE(r.code == 0);
  CHECK(r.out.find("Eq 13") != std::string::npos);
  for (const char* file : {"tables.txt", "ablation.json", "overlays.png", "ate_over_time.png", "map.png", "trajectory_none.png",
                           "trajectory_both.png", "both/map.ot", "geometric/masks/1000000.000000.png"}) {
    CAPTURE(file);
    CHECK(std::filesystem::exists(folder.path / "o" / file));
  }
}
#endif
