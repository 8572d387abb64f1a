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
#include <sstream>
#include <string>

#include "program.hpp"
#include "replayed_sequence.hpp"
#include "run_fixture.hpp"
#include "tum_fixture.hpp"

using dynslam::test::call, dynslam::test::check_one_line_error, dynslam::test::ProgramResult,
    dynslam::test::shell;

namespace {

std::ptrdiff_t lines_with(const std::string& text, const std::string& part) {
  std::istringstream in(text);
  std::ptrdiff_t count = 0;
  for (std::string line; std::getline(in, line);) count += line.find(part) != std::string::npos ? 1 : 0;
  return count;
}

/// Three seconds along xyz, one person walking, made by the program once for all tests of this file.
const std::string& three_seconds() {
  static const dynslam::test::TemporaryFolder folder;
  static const std::string path = [] {
    const std::string made = (folder.path / "s").string();
    REQUIRE(call("synth " + made + " --frames 90 --path xyz --walkers 1").code == 0);
    return made;
  }();
  return path;
}

/// The same back and forth for two minutes: a run of it does not end before a signal reaches it, however busy
/// the machine is.
const std::string& two_minutes() {
  static const dynslam::test::TemporaryFolder folder;
  static const std::string path = [] {
    dynslam::test::replay(three_seconds(), folder.path, 3600);
    return folder.path.string();
  }();
  return path;
}

}  // namespace

TEST_CASE("help and version succeed everywhere") {
  CHECK(call("--version").out.rfind("dynslam 0.", 0) == 0);
  for (const char* command : {"", "run", "eval", "eval-masks", "ablate", "synth"}) {
    const ProgramResult r = call(std::string(command) + " --help");
    CHECK(r.code == 0);
    CHECK(r.out.find("--help") != std::string::npos);
  }
}

TEST_CASE("errors are one line on stderr with a non-zero code") {
  const dynslam::test::TumFixture tum(3);
  const std::string path = tum.path.string();
  check_one_line_error("", 2, "subcommand");
  check_one_line_error("run " + path + " --out " + path + "/o --dynamics magic", 2, "magic");
  check_one_line_error("run " + path + "/absent --out " + path + "/o --dynamics none", 1, "does not exist");
  check_one_line_error("run " + path + " --out " + path + "/o --dynamics both", 2, "--masks");
  check_one_line_error("run " + path + " --out " + path + "/o --min-score 0.5", 2,
                       "--min-score is of a network");
  check_one_line_error("run " + path + " --out " + path + "/o --mask-labels voc", 2, "give --masks DIR");
  check_one_line_error("run " + path + " --out " + path + "/o --live-speed 2", 2, "the pace of --live");
  check_one_line_error("run " + path + " --model m.onnx --segment-every 0", 2, "nor auto");
  check_one_line_error("run " + path + " --out " + path + "/o --model " + path + "/absent.onnx", 1,
                       "absent.onnx: is not a file");
  check_one_line_error("run " + path + " --out " + path + "/o --model " + path + "/camera.txt", 1,
                       "camera.txt: cannot be loaded");
  check_one_line_error("run " + path + " --out " + path + "/o --model " + path + "/m.onnx --masks " + path, 2,
                       "exclude each other");
  check_one_line_error("run " + path + " --out " + path + "/o --model m.onnx --engine tensorrt", 2,
                       "tensorrt");
  check_one_line_error("run " + path + " --out " + path + "/o --dynamics none --camera fr7", 2,
                       "unknown camera 'fr7': neither fr1, fr2, fr3, bonn, azure_kinect, icl_nuim,");
  CHECK(call("info " + path + " --camera tum_fr3").code == 0);
  check_one_line_error("run " + path + " --out /proc/no --dynamics none", 1, "/proc/no");
  check_one_line_error("eval " + path + "/groundtruth.txt " + path + "/rgb.txt", 1,
                       "rgb.txt:1: expected 8 columns");
  check_one_line_error("eval " + path + "/groundtruth.txt " + path + "/groundtruth.txt", 1,
                       "the positions of ");
  check_one_line_error("eval-masks " + path + " " + path + "/absent", 1, "does not exist");
  check_one_line_error("eval-masks " + path, 1, "holds no PNG masks");
  check_one_line_error("mask-faults " + path + " " + path + "/f --fault upside-down", 2, "upside-down");
  check_one_line_error("synth " + path + "/s --scenario party", 2, "unknown scenario 'party'");
  check_one_line_error("synth " + path + "/s --size 848", 2, "'848' is not a size as 848x480");
  check_one_line_error("synth " + path + "/s --size 10x9999", 2, "must be from 64x64 to 4096x4096");
  check_one_line_error("synth " + path + "/s --size 64x48", 2, "must be from 64x64 to 4096x4096");
  check_one_line_error("run " + path + "/s --map-memory 1.5", 2,
                       "'1.5' is not a whole number from 1 to 1000000");
  check_one_line_error("rnu " + path, 2, "unknown command 'rnu', did you mean run?");
  check_one_line_error("run " + path + " --dynamcis none", 2, "--dynamcis, did you mean --dynamics?");
  check_one_line_error("run " + path + " --save-mask --max-frames=2", 2, "did you mean --save-masks?");
  check_one_line_error("qwertz", 2, "unknown command 'qwertz' (see");
  check_one_line_error("run " + path + " --out " + path + "/o --max-frames -1", 2,
                       "--max-frames: '-1' is not a whole number");
  check_one_line_error("run " + path + " --out " + path + "/o --tau nan", 2,
                       "--tau: 'nan' is not a number above 0");
}

TEST_CASE("a sequence is enough to start: no network means geometry, results have a place") {
  const dynslam::test::WalkingSequence sequence(4);
  const dynslam::test::TemporaryFolder folder;
  const ProgramResult r = shell("cd " + folder.path.string() + " && " + DYNSLAM_PROGRAM + " run " +
                                sequence.path.string() + "/ --no-map --no-loops");
  CHECK(r.code == 0);
  CHECK(r.out.find("found by its geometry alone (--dynamics geometric)") != std::string::npos);
  const auto out = folder.path / "results" / sequence.path.filename();
  CHECK(std::filesystem::exists(out / "trajectory.txt"));
  CHECK_FALSE(std::filesystem::exists(out / "map.sot"));
}

TEST_CASE("a live run says what it dropped, how late the rest was, and that another one will differ") {
  const dynslam::test::WalkingSequence sequence(6);
  const dynslam::test::TemporaryFolder folder;
  const std::string run = "run " + sequence.path.string() + " --no-map --out " + folder.path.string();
  const ProgramResult r = call(run + " --live --live-speed 20");
  CHECK(r.code == 0);
  CHECK(r.out.find(" of 6 frames dropped; latency median ") != std::string::npos);
  CHECK(r.out.find("another run has other results") != std::string::npos);
  check_one_line_error(run + " --live --live-speed 0", 2, "--live-speed: '0' is not a number");
  CHECK(call(run).out.find("dropped") == std::string::npos);
}

TEST_CASE("a sequence without anything to track ends with an error, and its files are there") {
  const dynslam::test::TumFixture tum(3);
  const ProgramResult r =
      call("run " + tum.path.string() + " --out " + (tum.path / "o").string() + " --dynamics none");
  CHECK(r.code == 1);
  CHECK(r.out.find("no frame could be tracked") != std::string::npos);
  CHECK(std::filesystem::exists(tum.path / "o" / "summary.json"));
}

TEST_CASE("eval prints the documented JSON, from options of a config file too") {
  const dynslam::test::TemporaryFolder folder;
  const std::string gt = (folder.path / "gt.txt").string(), config = (folder.path / "c.toml").string();
  {
    std::ofstream out(gt);
    for (int i = 0; i < 90; ++i)
      out << i / 30.0 << ' ' << std::sin(0.1 * i) << ' ' << std::cos(0.1 * i) << ' ' << 0.01 * i
          << " 0 0 0 1\n";
    std::ofstream(config) << "[eval]\njson = true\n";
  }
  for (const std::string& arguments :
       {"eval " + gt + " " + gt + " --json", "eval --config " + config + " " + gt + " " + gt}) {
    const ProgramResult r = call(arguments);
    CAPTURE(r.out);
    REQUIRE(r.code == 0);
    const auto json = nlohmann::json::parse(r.out);
    CHECK(json["pairs"] == 90);
    for (const char* part : {"ate_m", "rpe_trans_m", "rpe_rot_deg"}) {
      for (const char* figure : {"rmse", "mean", "median", "std", "min", "max"})
        CHECK(json[part][figure].get<double>() < 1e-6);
    }
  }
}

TEST_CASE("eval of a run's folder prints both trajectories; of a file, or an earlier version's folder, one") {
  const dynslam::test::TemporaryFolder folder;
  const std::string path = folder.path.string(), gt = path + "/gt.txt";
  const auto write = [&](const std::string& name, double wobble) {
    std::ofstream out(path + "/" + name);
    for (int i = 0; i < 90; ++i)
      out << i / 30.0 << ' ' << std::sin(0.1 * i) << ' ' << std::cos(0.1 * i) << ' '
          << 0.01 * i + (i % 2 == 0 ? wobble : -wobble) << " 0 0 0 1\n";
  };
  write("gt.txt", 0);
  write("trajectory.txt", 0.01);
  const ProgramResult earlier = call("eval " + path + " " + gt);
  const ProgramResult file = call("eval " + path + "/trajectory.txt " + gt);
  REQUIRE(earlier.code == 0);
  CHECK(file.out.find("trajectory") == std::string::npos);
  CHECK(earlier.out == "In the end (trajectory.txt)\n" + file.out + "no live trajectory: " + path +
                           "/trajectory_live.txt is missing, as in runs of earlier versions\n");
  const auto json_of = [&](const std::string& estimate) {
    const ProgramResult r = call("eval " + estimate + " " + gt + " --json");
    CAPTURE(r.out);
    REQUIRE(r.code == 0);
    return nlohmann::json::parse(r.out);
  };
  CHECK(json_of(path)["live"].is_null());

  write("trajectory_live.txt", 0.03);
  const ProgramResult live_file = call("eval " + path + "/trajectory_live.txt " + gt);
  CHECK(call("eval " + path + " " + gt).out == "In the end (trajectory.txt)\n" + file.out +
                                                   "As the frames came (trajectory_live.txt)\n" +
                                                   live_file.out);
  nlohmann::json both = json_of(path);
  CHECK(both["live"] == json_of(path + "/trajectory_live.txt"));
  CHECK(both["live"]["ate_m"]["rmse"].get<double>() == doctest::Approx(0.03).epsilon(0.01));
  both.erase("live");
  CHECK(both == json_of(path + "/trajectory.txt"));
  CHECK(both["ate_m"]["rmse"].get<double>() == doctest::Approx(0.01).epsilon(0.01));

  std::ofstream(path + "/trajectory_live.txt") << "0 0 0 0 0 0 0 1\n0.1 0 0 0 0 0 0 1\n";
  const ProgramResult few = call("eval " + path + " " + gt);
  CHECK(few.code == 0);
  CHECK(few.out.find(file.out + "no live trajectory: ") != std::string::npos);
  CHECK(json_of(path)["live"].is_null());
}

TEST_CASE(
    "a config file: the command line wins, other commands' sections do not count, mistakes name their line") {
  const dynslam::test::TumFixture tum(5);
  const std::string path = tum.path.string(), config = path + "/c.toml", out = path + "/o";
  const auto write = [&](const std::string& text) { std::ofstream(config) << text; };
  const auto configuration = [&](const std::string& arguments) {
    call("run " + arguments + " --config " + config);  // fails later: there is nothing to track
    std::ifstream in(out + "/summary.json");
    return nlohmann::json::parse(in)["configuration"];
  };
  write("# all of run\nsequence = '" + path + "'\nout = \"" + out +
        "\"  # quoted\ndynamics = none\nmap = false\n" +
        "max-frames = 2\n[ablate]\nmax-frames = 1\n[run]\nseed = 7\n");
  auto j = configuration("");
  CHECK(j["dynamics"] == "none");
  CHECK(j["map"] == false);
  CHECK(j["max_frames"] == 2);
  CHECK(j["seed"] == 7);
  j = configuration("--max-frames 4");
  CHECK(j["max_frames"] == 4);
  CHECK(j["seed"] == 7);

  const std::string run = "run " + path + " --out " + out + " --config " + config;
  write("dynamics = none\n\nmax-frame = 3\n");
  check_one_line_error(run, 1, "c.toml:3: unknown option 'max-frame' of run, did you mean max-frames?");
  write("[run]\ndynamics none\n");
  check_one_line_error(run, 1, "c.toml:2: key-value pair: expected '=', saw 'n'");
  write("[walk]\n");
  check_one_line_error(run, 1, "c.toml:1: unknown table [walk]");
  write("seed = 1\ndynamics = magic\n");
  check_one_line_error(run, 1, "c.toml:2: --dynamics: magic");
  write("seed = 1\nseed = 2\n");
  check_one_line_error(run, 1, "c.toml:2: key-value pair: cannot redefine existing integer 'seed'");
  check_one_line_error("run " + path + " --out " + out + " --config " + path + "/absent", 1,
                       "absent: cannot be opened");
}

TEST_CASE("a run says in one line what was broken, and how accurate it was") {
  const dynslam::test::TemporaryFolder folder;
  const std::string path = folder.path.string();
  std::filesystem::copy(three_seconds(), folder.path / "s", std::filesystem::copy_options::recursive);
  for (const char* stamp : {"1000000.500000", "1000000.600000", "1000000.700000"}) {
    std::filesystem::resize_file(folder.path / "s" / "rgb" / (std::string(stamp) + ".png"), 5000);
  }
  const ProgramResult r =
      call("run " + path + "/s --out " + path + "/o --dynamics none --map false --max-frames 40");
  CAPTURE(r.out);
  CHECK(r.code == 0);
  CHECK(lines_with(r.out, "warning") == 1);
  CHECK(r.out.find("3 broken and 0 lost of 40 frames: ") != std::string::npos);
  CHECK(r.out.find("1000000.500000.png: is truncated") != std::string::npos);
  CHECK(r.out.find("37 of 40 frames tracked") != std::string::npos);
  CHECK(lines_with(r.out, "ATE [m]") == 2);      // in the end, and as the frames came
  CHECK(r.out.find('\r') == std::string::npos);  // no progress line where nobody watches
  CHECK_FALSE(std::filesystem::exists(folder.path / "o" / "map.sot"));
}

TEST_CASE("an interrupted run keeps what it has and exits with 130") {
  const dynslam::test::TemporaryFolder folder;
  const std::string path = folder.path.string();
  const std::string& sequence = two_minutes();
  // summary.json appears when the run begins.
  const ProgramResult r =
      shell(std::string(DYNSLAM_PROGRAM) + " run " + sequence + " --out " + path +
            "/o --dynamics geometric 2>&1 & pid=$!; " + "for i in $(seq 3000); do [ -e " + path +
            "/o/summary.json ] && break; sleep 0.01; done; " + "sleep 0.1; kill -INT $pid; wait $pid");
  CAPTURE(r.out);
  CHECK(r.code == 130);
  CHECK(r.out.find("interrupted; what was computed is saved") != std::string::npos);
  std::ifstream in(folder.path / "o" / "summary.json");
  const auto summary = nlohmann::json::parse(in);
  CHECK(summary["interrupted"] == true);
  CHECK(summary["frames"].get<int>() < 3600);
  CHECK(std::filesystem::exists(folder.path / "o" / "trajectory.txt"));
}

namespace {

/// Starts a run in the background and sends it a signal once its trajectory has some lines and its summary,
/// which is written after it, some frames.
ProgramResult run_and_signal(const std::string& path, const std::string& signal, int frames,
                             const std::string& prefix = {}) {
  return shell(prefix + std::string(DYNSLAM_PROGRAM) + " run " + two_minutes() + " --max-frames " +
               std::to_string(frames) + " --out " + path +
               "/o --dynamics geometric --map false --save-every 0.1 > " + path + "/log 2>&1 & pid=$!; " +
               "for i in $(seq 3000); do [ \"$(cat " + path +
               "/o/trajectory.txt 2>/dev/null | wc -l)\" -gt 5 ] && grep -qs '\"tracked\": [1-9]' " + path +
               "/o/summary.json && break; sleep 0.01; done; kill -" + signal + " $pid; wait $pid");
}

nlohmann::json summary_of(const std::string& path) {
  std::ifstream in(path + "/o/summary.json");
  return nlohmann::json::parse(in);
}

}  // namespace

TEST_CASE(
    "a killed run leaves its trajectory and its summary so far; a closed terminal ends it like Ctrl-C") {
  const dynslam::test::TemporaryFolder folder;
  const std::string path = folder.path.string();
  (void)two_minutes();  // made before the first run is waited for
  CHECK(run_and_signal(path, "KILL", 3600).code == 137);
  auto summary = summary_of(path);
  CHECK(summary["interrupted"] == true);
  CHECK(summary["tracked"].get<int>() >= 1);
  for (const char* file : {"/o/trajectory.txt", "/o/trajectory_live.txt"})
    CHECK(shell("awk '!/^#/ && NF != 8' " + path + file).out.empty());
  std::filesystem::remove_all(path + "/o");
  CHECK(run_and_signal(path, "HUP", 3600).code == 130);
  summary = summary_of(path);
  CHECK(summary["interrupted"] == true);
  CHECK(summary["frames"].get<int>() < 3600);
  CHECK(summary["stages"].contains("frame"));  // written by the end of the run, not by the way
  std::filesystem::remove_all(path + "/o");
  CHECK(run_and_signal(path, "HUP", 60, "nohup ").code == 0);  // nohup means it
  CHECK(summary_of(path)["frames"] == 60);
}

TEST_CASE("a disk that the masks fill has room for the trajectory, and the error is told") {
  const dynslam::test::TemporaryFolder folder;
  const std::string path = folder.path.string();
  const std::string disk = "unshare -rm sh -c 'mount -t tmpfs -o size=400k none " + path + "/o && ";
  std::filesystem::create_directories(path + "/o");
  if (shell(disk + "true' 2>/dev/null").code != 0) {
    MESSAGE("skipped: this system does not let a user mount a small disk");
    return;
  }
  REQUIRE(call("synth " + path + "/s --frames 45 --path xyz").code == 0);
  const ProgramResult r =
      shell(disk + DYNSLAM_PROGRAM + " run " + path + "/s --out " + path + "/o --masks " + path +
            "/s/instance --dynamics semantic --map false --save-masks; echo code $?; cp " + path + "/o/*.* " +
            path + "' 2>&1");
  CAPTURE(r.out);
  CHECK(r.out.find("code 1") != std::string::npos);
  CHECK(r.out.find("No space left on device") != std::string::npos);
  std::ifstream in(path + "/summary.json");
  const auto summary = nlohmann::json::parse(in);
  CHECK(summary["tracked"].get<int>() > 3);
  const ProgramResult lines = shell("grep -vc '^#' " + path + "/trajectory.txt");
  CHECK(std::stoi(lines.out) == summary["tracked"].get<int>());
}

TEST_CASE("output to a full disk or a closed reader is an error") {
  const dynslam::test::TumFixture tum(3);
  const std::string eval = std::string(DYNSLAM_PROGRAM) + " synth --help";
  CHECK(shell(eval + " > /dev/full 2>&1").code == 1);
  const std::string line = "dynslam: error: the standard output could not be written";
  CHECK(shell(eval + " 2>&1 > /dev/full").out.find(line) == 0);
  CHECK(shell(eval + " 2>&1 >&-").out.find(line) == 0);
  // The reader has gone when the program writes.
  const std::string code = tum.path.string() + "/code";
  (void)shell("(sleep 0.2; " + eval + " 2>/dev/null; echo $? > " + code + ") | true");
  CHECK(shell("cat " + code).out == "1\n");
}

TEST_CASE("a configuration that cannot be read to its end is an error, and a pipe is none") {
  const dynslam::test::TumFixture tum(3);
  const std::string path = tum.path.string(), run = "run " + path + " --out " + path + "/o --config ";
  check_one_line_error(run + "/proc/self/mem", 1, "/proc/self/mem: cannot be read: Input/output error");
  check_one_line_error(run + "/dev/zero", 1, "/dev/zero: is not a regular file");
  REQUIRE(shell("mkfifo " + path + "/pipe").code == 0);
  check_one_line_error(run + path + "/pipe", 1, "pipe: is not a regular file");
  check_one_line_error("run " + path + " --config=" + path + "/pipe --out " + path + "/o", 1,
                       "not a regular");
}

TEST_CASE("memory that runs out is told in words") {
#if defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
  MESSAGE("skipped: a sanitizer needs more addresses than the limit leaves");
  return;
#endif
#endif
  const dynslam::test::TumFixture tum(3);
  const std::string path = tum.path.string();
  // A map that takes more than there is.
  const ProgramResult r = shell("mkdir " + path + "/m; truncate -s 8G " + path +
                                "/m/keyframes.bin; ulimit -v 4000000; " + DYNSLAM_PROGRAM + " run " + path +
                                " --out " + path + "/o --dynamics none --load-map " + path + "/m 2>&1");
  CHECK(r.code == 1);
  CHECK(r.out == "dynslam: error: there is not enough memory\n");
}
