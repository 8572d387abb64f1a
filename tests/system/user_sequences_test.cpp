// SPDX-License-Identifier: BSD-3-Clause
// Images, cameras and names as people have them, and some that nobody should have.
#include <doctest/doctest.h>
#include <fmt/format.h>

#include <filesystem>
#include <functional>
#include <opencv2/imgcodecs.hpp>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "dynslam/runtime/io/image_io.hpp"
#include "mask_files.hpp"
#include "user_input.hpp"

namespace fs = std::filesystem;
using namespace dynslam::test;

TEST_CASE("names of images that differ by a number are paired, whatever stands around it") {
  /// Moves the images to color/ and depth/ under names of number and time.
  using Name = std::function<std::string(std::size_t, double)>;
  const auto named = [](const Name& colour, const Name& depth) {
    return [=](const fs::path& root) {
      std::istringstream in(text_of(root / "rgb.txt"));
      fs::create_directories(root / "new");
      std::size_t i = 0;
      fs::rename(root / "depth", root / "old");
      fs::create_directories(root / "color");
      fs::create_directories(root / "depth");
      for (std::string line; std::getline(in, line);) {
        if (line.starts_with('#')) continue;
        const std::string file = fs::path(line.substr(line.find(' ') + 1)).filename().string();
        fs::rename(root / "rgb" / file, root / "color" / (colour(i, std::stod(line)) + ".png"));
        fs::rename(root / "old" / file, root / "depth" / (depth(i, std::stod(line)) + ".png"));
        ++i;
      }
      for (const char* list :
           {"rgb", "old", "new", "rgb.txt", "depth.txt", "associations.txt", "groundtruth.txt"})
        fs::remove_all(root / list);
    };
  };
  const auto number = [](const char* before, int digits, const char* behind) {
    return Name(
        [=](std::size_t i, double) { return fmt::format("{}{:0{}}{}", before, i + 3, digits, behind); });
  };
  const std::vector<std::string> all{"8 of 8 frames tracked"};
  const auto same = [&](const Name& name) { return named(name, name); };
  check_all({
      {"frame_0001", same(number("frame_", 4, "")), kRun, 0, all},
      {"img_0001", same(number("img_", 4, "")), kRun, 0, all},
      {"frame-1", same(number("frame-", 1, "")), kRun, 0, all},
      {"frame-1, named format", same(number("frame-", 1, "")), std::string(kRun) + " --format redwood", 0,
       all},
      {"rgb_1, depth_1", named(number("rgb_", 1, ""), number("depth_", 1, "")), kRun, 0, all},
      {"1_color, 1_depth", named(number("", 1, "_color"), number("", 1, "_depth")), kRun, 0, all},
      {"a number in the prefix", same(number("cam2 640x480 ", 3, "")), kRun, 0, all},
      {"seconds", same([](std::size_t, double t) { return fmt::format("{:.6f}", t + 1.3e9); }), kRun, 0, all},
      {"nanoseconds", same([](std::size_t, double t) { return fmt::format("{:.0f}", 1e9 * (t + 1.3e9)); }),
       kRun, 0, all},
      {"one of another name",
       [=](const fs::path& root) {
         same(number("f", 3, ""))(root);
         fs::copy_file(root / "color" / "f003.png", root / "color" / "preview.png");
       },
       kRun,
       0,
       {"8 of 8 frames tracked", "1 of 9 images in ", "are left out, the first preview.png"}},
      {"numbers that do not meet",
       named([](std::size_t i, double) { return std::to_string(i); },
             [](std::size_t i, double) { return std::to_string(i + 100); }),
       kRun,
       1,
       {"none of its 8 colour and 8 depth images have a number in common"}},
      {"no numbers",
       same([](std::size_t i, double) { return std::string(1, static_cast<char>('a' + i)); }),
       kRun,
       1,
       {"is of no known format", "color/ holds a.png, b.png", "depth/ holds a.png"}},
      {"no numbers, named format",
       same([](std::size_t i, double) { return std::string(1, static_cast<char>('a' + i)); }),
       std::string(kRun) + " --format redwood",
       1,
       {"has no images of this format: color/, image/ or rgb/ with PNG or JPEG files"}},
  });
}

TEST_CASE("info says why frames cannot be decoded, and does not advise to run them") {
  const auto depth = [](int type, double factor) {
    return [=](const fs::path& root) {
      for (const auto& entry : fs::directory_iterator(root / "depth")) {
        cv::Mat image = dynslam::runtime::read_image(entry.path(), cv::IMREAD_UNCHANGED), changed;
        image.convertTo(changed, CV_MAT_DEPTH(type), factor);
        if (CV_MAT_CN(type) > 1) cv::merge(std::vector<cv::Mat>(3, changed), changed);
        dynslam::runtime::write_image(entry.path(), changed);
      }
    };
  };
  const std::vector<std::string> never{"warnings  none", "dynslam run"};
  check_all({
      {"8 bits",
       depth(CV_8UC1, 1.0 / 256),
       kInfo,
       0,
       {"8 of 8 frames looked at cannot be decoded, the first: ", "has 8 bits and 1 channel\n"},
       never},
      {"three channels", depth(CV_16UC3, 1), kInfo, 0, {"has 16 bits and 3 channels\n"}, never},
      {"8 bits, run", depth(CV_8UC1, 1.0 / 256), kRun, 1, {"has 8 bits and 1 channel"}},
      {"no depth at all", depth(CV_16UC1, 0), kInfo, 0, {"only 0 % of the pixels have depth"}},
      {"no depth at all, convert",
       depth(CV_16UC1, 0),
       "convert SEQ OUT",
       0,
       {"8 of 8 depth images have no depth at all"}},
      {"no depth at all, run",
       depth(CV_16UC1, 0),
       kRun,
       1,
       {"no frame could be tracked: none of 8 depth images has a valid depth"}},
  });
}

TEST_CASE("cameras are read as people have them: ORB-SLAM's settings and Open3D's JSON") {
  const std::string run = "run SEQ --camera SEQ/own --dynamics none --no-map --out OUT";
  const auto camera = [](const std::string& text) {
    return [=](const fs::path& root) { write_text(root / "own", text); };
  };
  const std::string orb =
      "%YAML:1.0\n\n# Camera calibration\nCamera.fx: 267.7\nCamera.fy: 269.6\nCamera.cx: 159.8\nCamera.cy: "
      "123.55\nCamera.k1: 0.0\nCamera.k2: 0.0\nCamera.p1: 0.0\nCamera.p2: 0.0\nCamera.width: "
      "320\nCamera.height: "
      "240\nCamera.fps: 30.0\nCamera.bf: 40.0\nCamera.RGB: 1\nThDepth: 40.0\nDepthMapFactor: 5000.0\n"
      "ORBextractor.nFeatures: 1000\n";
  const std::string orb3 =
      "%YAML:1.0\nFile.version: \"1.0\"\nCamera.type: \"PinHole\"\nCamera1.fx: 267.7\nCamera1.fy: "
      "269.6\nCamera1.cx: 159.8\nCamera1.cy: 123.55\nCamera1.k1: 0.0\nCamera.width: 320\nCamera.height: "
      "240\nRGBD.DepthMapFactor: 5000.0\n";
  const std::string open3d =
      "{\"width\": 320, \"height\": 240, \"intrinsic_matrix\": [267.7, 0, 0, 0, 269.6, 0, 159.8, 123.55, 1], "
      "\"depth_units_per_metre\": 5000}";
  check_all({{"ORB-SLAM2", camera(orb), run, 0, kTracked},
             {"ORB-SLAM3", camera(orb3), run, 0, kTracked},
             {"ORB-SLAM's unknown lens",
              camera(filled(orb3, "PinHole", "Mei")),
              run,
              1,
              {"own:3: Camera.type 'Mei' is none of PinHole, KannalaBrandt8, Rectified"}},
             {"ORB-SLAM without a size",
              camera(filled(orb, "Camera.width: 320\n", "")),
              run,
              1,
              {"own: 'width' is missing"}},
             {"Open3D", camera(open3d), run, 0, kTracked},
             {"Open3D by rows",
              camera(filled(open3d, "267.7, 0, 0, 0, 269.6, 0, 159.8",
                            "267.7, 0, 159.8, 0, 269.6, "
                            "0, 0")),
              run,
              1,
              {"is not [fx, 0, 0, 0, fy, 0, cx, cy, 1]"}},
             {"JSON of something else",
              camera("{\"a\": 1}"),
              run,
              1,
              {"own: \"intrinsic_matrix\" with 9 numbers is missing"}}});
}

TEST_CASE("names that are more than names are refused where they enter, and obeyed nowhere") {
  const auto sweep = [](const std::string& text) {
    return [=](const fs::path& root) { write_text(root / "s.toml", text); };
  };
  const std::string list = "sweep SEQ/s.toml --out OUT --gather";
  const auto renamed = [](const std::string& name) {
    return [=](const fs::path& root) {
      fs::create_directories(root / name);
      for (const char* file : {"rgb", "depth", "associations.txt", "camera.txt"})
        fs::rename(root / file, root / name / file);
    };
  };
  check_all({
      {"a line break in a sequence",
       sweep("sequences = [\"a\\nrm -rf x\"]\nmodes = [\"none\"]\n"),
       list,
       1,
       {"s.toml:1: sequences: 'a\\x0arm -rf x' has a control character"}},
      {"a line break in an option",
       sweep("sequences = [\".\"]\nmodes = [\"none\"]\n[options]\ncamera = \"fr1\\n-x\"\n"),
       list,
       1,
       {"s.toml:4: camera: 'fr1\\x0a-x' has a control character"}},
      {"an option for a sequence",
       sweep("sequences = [\"-h\"]\nmodes = [\"none\"]\n"),
       list,
       1,
       {"sequences: '-h' reads as an option: write ./-h"}},
      {"help as an option",
       sweep("sequences = [\".\"]\nmodes = [\"none\"]\n[options]\nhelp = true\n"),
       list,
       1,
       {"help is no option of a sweep's runs"}},
      {"a folder that a terminal obeys",
       renamed("a\x1b[31m"),
       "info SEQ/$(printf 'a\\033[31m')",
       1,
       {"a\\x1b[31m: has a control character in its name"},
       {"\x1b"}},
      {"a missing folder that a terminal obeys",
       {},
       "info SEQ/$(printf 'b\\033[31m')",
       1,
       {"b\\x1b[31m"},
       {"\x1b"}},
      {"no size", {}, "convert SEQ OUT --size 0x0", 2, {"'0x0' is not a size"}},
  });
}

TEST_CASE("a map is not exported onto itself, and lengths have bounds") {
  const TemporaryFolder folder;
  copy_sequence(folder.path / "seq");
  const std::string at = folder.path.string(), map = at + "/o/map.sot";
  REQUIRE(call("run " + at + "/seq --dynamics none --out " + at + "/o").code == 0);
  const std::string before = text_of(map);
  check_one_line_error("map export " + map + " " + map, 2, "is the map itself");
  fs::create_hard_link(map, folder.path / "same.sot");
  check_one_line_error("map export " + map + " " + at + "/same.sot", 2, "is the map itself");
  CHECK(text_of(map) == before);
  check_one_line_error("map query " + map + " --at 0 0 1 --cell -1", 2, "--cell");
  CHECK(mentions(call("run " + at + "/seq --out " + at + "/g").out,
                 "people and things that never move during the run are part of it"));
}

TEST_CASE("a damaged octree is not copied from one saved map to the next") {
  const TemporaryFolder folder;
  copy_sequence(folder.path / "seq");
  const std::string at = folder.path.string(), run = "run " + at + "/seq --dynamics none --out " + at + "/o ";
  REQUIRE(call(run + "--save-map " + at + "/m").code == 0);
  const std::string next = run + "--no-map --load-map " + at + "/m --save-map " + at + "/n";
  REQUIRE(call(next).code == 0);
  CHECK(text_of(folder.path / "n" / "map.sot") == text_of(folder.path / "m" / "map.sot"));
  fs::remove_all(folder.path / "n");
  fs::resize_file(folder.path / "m" / "map.sot", fs::file_size(folder.path / "m" / "map.sot") / 2);
  const ProgramResult refused = call(next);
  CHECK(refused.code == 1);
  CHECK(mentions(refused.out, "m/map.sot"));
  CHECK_FALSE(fs::exists(folder.path / "n" / "map.sot"));
}

TEST_CASE("masks are compared as they are used: by the rule of their folder, which is said") {
  using dynslam::test::two_boxes;
  const TemporaryFolder folder;
  const std::string at = folder.path.string();
  const auto write = [&](const char* name, double left, double right) {
    fs::create_directories(folder.path / name);
    for (const char* stamp : {"1.png", "2.png"})
      dynslam::runtime::write_image(folder.path / name / stamp, two_boxes({160, 120}, CV_8UC1, left, right));
  };
  write("truth", 255, 0);
  write("grey", 128, 0);
  write("labels", 15, 9);
  write("nothing", 0, 0);
  const auto compared = [&](const std::string& masks) { return call("eval-masks " + at + "/" + masks); };
  CHECK(mentions(compared("grey " + at + "/truth").out, "recall 1.0000, IoU 1.0000"));
  CHECK(mentions(compared("labels --mask-labels 15=person,9=chair " + at + "/truth").out,
                 "recall 1.0000, IoU 1.0000"));
  const ProgramResult unnamed = compared("labels " + at + "/truth");
  CHECK(unnamed.code == 1);
  CHECK(mentions(unnamed.out, "--mask-labels"));
  CHECK(mentions(compared("grey").out, "masks cover 6.25 % of a frame's pixels"));
  CHECK(mentions(compared("grey").out, "\nmasks: "));
  CHECK(mentions(compared("nothing " + at + "/truth").out, "recall 0.0000"));
  CHECK(mentions(compared("nothing").out, "masks cover 0.00 %"));
}
