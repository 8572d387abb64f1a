// SPDX-License-Identifier: BSD-3-Clause
// Other processes, interruptions, and files that ask for more than there is: a line each, and nothing lost.
#include <doctest/doctest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "constant_onnx.hpp"
#include "dynslam/runtime/nets/inference_engine.hpp"
#include "error_text.hpp"
#include "program.hpp"
#include "small_sequence.hpp"

namespace fs = std::filesystem;
using namespace dynslam::test;

namespace {

/// A network of one node, and the inputs that it has beside the image.
void write_single_node(const fs::path& file, const Message& node, const Message& constant) {
  Message graph;
  graph.message(1, node).message(5, constant).bytes(2, "single");
  graph.message(11, typed_value_info("image", {1, 3, 48, 64}, kOnnxFloat));
  graph.message(12, typed_value_info("out", {-1, -1, -1, -1}, kOnnxFloat));
  Message model;
  model.number(1, 7).message(7, graph).message(8, Message().bytes(1, "").number(2, 12));
  std::ofstream(file, std::ios::binary) << model.text();
}

/// Hands the image through a loop whose condition stays true.
void write_endless(const fs::path& file) {
  constexpr int kBool = 9;
  const auto same = [](const char* in, const char* out) {
    return Message().bytes(1, in).bytes(2, out).bytes(4, "Identity");
  };
  Message body;
  body.message(1, same("again", "again_out")).message(1, same("x", "x_out")).bytes(2, "body");
  body.message(11, typed_value_info("turn", {}, kOnnxInt64));
  body.message(11, typed_value_info("again", {}, kBool));
  body.message(11, typed_value_info("x", {1, 3, 48, 64}, kOnnxFloat));
  body.message(12, typed_value_info("again_out", {}, kBool));
  body.message(12, typed_value_info("x_out", {1, 3, 48, 64}, kOnnxFloat));
  const Message loop = Message()
                           .bytes(1, "")
                           .bytes(1, "true")
                           .bytes(1, "image")
                           .bytes(2, "out")
                           .bytes(4, "Loop")
                           .message(5, Message().bytes(1, "body").message(6, body).number(20, 5));
  write_single_node(file, loop, Message().number(2, kBool).bytes(8, "true").bytes(9, std::string("\1", 1)));
}

/// Repeats the image to 9.7 GB.
void write_huge(const fs::path& file) {
  const Message tile = Message().bytes(1, "image").bytes(1, "times").bytes(2, "out").bytes(4, "Tile");
  std::string times(32, '\0');  // of the four dimensions, 64 bits each
  times[0] = times[8] = 1;
  times[17] = times[25] = 2;  // 512
  write_single_node(file, tile,
                    Message().number(1, 4).number(2, kOnnxInt64).bytes(8, "times").bytes(9, times));
}

}  // namespace

TEST_CASE("a folder of results is one process' own as long as it writes there") {
  const TemporaryFolder folder;
  copy_sequence(folder.path / "seq");
  const std::string at = folder.path.string(),
                    run = "run " + at + "/seq --dynamics none --no-map --out " + at + "/o";
  fs::create_directories(folder.path / "o");
  // flock(1) holds the folder as a run does.
  const ProgramResult second =
      shell("flock " + at + "/o " + std::string(DYNSLAM_PROGRAM) + " " + run + " 2>&1");
  CHECK(second.code == 1);
  CHECK(mentions(second.out, "o: is where another process writes its results now"));
  CHECK(fs::is_empty(folder.path / "o"));
  CHECK(call(run).code == 0);
  CHECK(call(run).code == 0);  // the first one has left no lock
}

TEST_CASE(
    "a map is not saved in place of the folder that the program runs in, and that is said before the run") {
  const TemporaryFolder folder;
  copy_sequence(folder.path / "seq");
  const std::string at = folder.path.string();
  fs::create_directories(folder.path / "here");
  for (const char* name : {".", "./", "../here", "../here/."}) {
    CAPTURE(name);
    const ProgramResult r =
        shell("cd " + at + "/here && " + DYNSLAM_PROGRAM + " run ../seq --dynamics none --out " + at +
              "/o --save-map " + name + " 2>&1");
    CHECK(r.code == 1);
    CHECK(mentions(r.out, "is the folder that the program runs in, which cannot be replaced"));
    CHECK(fs::is_empty(folder.path / "here"));
    CHECK_FALSE(fs::exists(folder.path / "o" / "trajectory.txt"));
  }
  fs::create_directories(folder.path / "there");
  CHECK(call("run " + at + "/seq --dynamics none --out " + at + "/o --save-map " + at + "/there/.").code ==
        0);
  CHECK(fs::exists(folder.path / "there" / "keyframes.bin"));
}

TEST_CASE("a conversion that was interrupted is begun anew by the same command") {
  const TemporaryFolder folder;
  copy_sequence(folder.path / "seq");
  const std::string at = folder.path.string(), convert = "convert " + at + "/seq " + at + "/c";
  // As it is left in the middle, with an image that the next conversion does not have.
  fs::create_directories(folder.path / "c" / "rgb");
  write_text(folder.path / "c" / "rgb" / "7.png", "half");
  CHECK(call(convert).code == 1);  // it may be anybody's
  write_text(folder.path / "c" / "unfinished.txt", "");
  check_one_line_error("info " + at + "/c", 1, "c: is not whole (unfinished.txt)");
  write_text(folder.path / "c" / "synth.json", "{}");  // then it is one of `synth`, with images of its own
  check_one_line_error(convert, 1, "is not an empty folder");
  check_one_line_error("synth ''", 1, "cannot be made a folder");
  fs::remove(folder.path / "c" / "synth.json");
  CHECK(call(convert).code == 0);
  CHECK_FALSE(fs::exists(folder.path / "c" / "rgb" / "7.png"));
  CHECK_FALSE(fs::exists(folder.path / "c" / "unfinished.txt"));
  CHECK(call("run " + at + "/c --dynamics none --no-map --out " + at + "/o").code == 0);
  CHECK(mentions(call(convert).out, "is not an empty folder"));
  fs::remove_all(folder.path / "c");
  const ProgramResult failed = call(convert + " --camera fr1");  // of another size: no frame can be read
  CHECK(failed.code == 1);
  CHECK(call(convert).code == 0);
}

TEST_CASE("a network without end is ended by one Ctrl-C, one without bound is refused") {
  if (!dynslam::runtime::has_onnxruntime()) {
    MESSAGE("skipped: built without ONNX Runtime");
    return;
  }
  const TemporaryFolder folder;
  copy_sequence(folder.path / "seq");
  const std::string at = folder.path.string(),
                    run = " run " + at + "/seq --no-map --out " + at + "/o --model " + at;
  write_endless(folder.path / "endless.onnx");
  for (const char* live : {"", " --live"}) {
    const ProgramResult r = shell("timeout -k 20 -s INT 2 " + std::string(DYNSLAM_PROGRAM) + run +
                                  "/endless.onnx" + live + " 2>&1");
    CAPTURE(r.out);
    CHECK(r.code == 124);  // of `timeout`, which had to kill nobody (137)
    CHECK(mentions(r.out, "dynslam: interrupted"));
  }
  // One request that comes twice, as `timeout` sends it.
  const ProgramResult twice = shell(std::string(DYNSLAM_PROGRAM) + run + "/endless.onnx 2>&1 & p=$!; " +
                                    "sleep 2; kill -INT $p; kill -INT $p; wait $p");
  CHECK(twice.code == 130);
  CHECK(mentions(twice.out, "dynslam: interrupted"));
  write_huge(folder.path / "huge.onnx");
  check_one_line_error(run.substr(1) + "/huge.onnx", 1, "it needs more than 4096 MB of memory");
}

TEST_CASE("lengths and sizes that nothing has are refused") {
  const TemporaryFolder folder;
  copy_sequence(folder.path / "seq");
  const std::string at = folder.path.string();
  REQUIRE(call("run " + at + "/seq --dynamics none --out " + at + "/o").code == 0);
  for (const char* cell : {"-1", "0", "1e-9", "1e300", "nan"})
    check_one_line_error("map export " + at + "/o/map.sot --grid " + at + "/g.pgm --cell " + cell, 2,
                         "--cell");
  check_one_line_error("synth " + at + "/s --size 0x0", 2, "'0x0' is not a size");
  for (const char* field : {"outlines]\nbeside", "outlines]\ngap"}) {
    write_text(folder.path / "c.toml", std::string("[tracker.geometry.belief.") + field + " = 1000000\n");
    check_one_line_error("run " + at + "/seq --out " + at + "/p --config " + at + "/c.toml", 1, "c.toml:2: ");
  }
}
