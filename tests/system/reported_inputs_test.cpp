// SPDX-License-Identifier: BSD-3-Clause
// Every input that people have reported: a row each, with the command and what the program says, or the test
// that has it. None is silent.
#include <doctest/doctest.h>

#include <array>
#include <cstdlib>
#include <filesystem>
#include <opencv2/core.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "dynslam/runtime/io/image_io.hpp"
#include "dynslam/runtime/nets/inference_engine.hpp"
#include "input_row.hpp"

namespace fs = std::filesystem;
using namespace dynslam::test;
using dynslam::runtime::write_image;

namespace {

/// Of inputs that are too large, or only make sense with a writer of their own: where they are tested.
struct Elsewhere {
  std::string_view row, file, test;
};

constexpr std::array kElsewhere{
    Elsewhere{"07 float depth in millimetres", "system/bag_sequence_test.cpp",
              "float depth in millimetres is read as what it is"},
    Elsewhere{"10 repeated stamps, a clock from 0", "system/bag_sequence_test.cpp",
              "a bag whose messages were all recorded twice is the bag"},
    Elsewhere{"11 every fault of a ground truth", "system/user_inputs_test.cpp",
              "a ground truth that is damaged stops nothing"},
    Elsewhere{"names", "system/user_sequences_test.cpp",
              "names of images that differ by a number are paired"},
    Elsewhere{"classes", "system/recognition_cli_test.cpp", "an own class has its name in the map"},
    Elsewhere{"cameras", "system/rolling_shutter_test.cpp", "a readout is measured from images"},
    Elsewhere{"unclear", "system/user_sequences_test.cpp", "cameras are read as people have them"},
    Elsewhere{"01 to 04 with the share that is masked", "system/recognition_cli_test.cpp",
              "networks and masks that users have reported"},
    Elsewhere{"untrusted names", "system/user_sequences_test.cpp", "names that are more than names"},
    Elsewhere{"unvalidated copies", "system/user_sequences_test.cpp",
              "a damaged octree is not copied from one saved map"},
    Elsewhere{"input is output", "system/user_sequences_test.cpp", "a map is not exported onto itself"},
    Elsewhere{"no check sum", "runtime/map_io_test.cpp", "whatever bit of a map is flipped"},
    Elsewhere{"the rest", "system/surroundings_cli_test.cpp", "a folder of results is one process' own"}};

std::vector<UserInput> reported_cases() {
  const std::string mask = "run CASES/04-mask-grey-values/seq --no-map --out OUT --dynamics semantic ",
                    truth = "run CASES/11-ground-truth-optional/seq --no-map --dynamics none --out OUT",
                    marked = "05-byte-order-mark/",
                    plain = "run CASES/04-mask-grey-values/seq --no-map --out OUT ";
  std::vector<UserInput> rows;
  const auto network = [&](const std::string& file, int code, const std::string& says) {
    rows.push_back({file, {}, mask + "-v --model CASES/" + file + ".onnx", code, {says}});
  };
  network("01-onnx-not-a-segmenter/c1_yolo_detect_1x84xN", 1, "seems to be a detector");
  network("01-onnx-not-a-segmenter/c3_rtdetr_1x300x84", 1, "seems to be a detector");
  network("01-onnx-not-a-segmenter/c4_yolo_end2end_1x300x6", 1, "seems to be a detector");
  network("01-onnx-not-a-segmenter/d2_depth_net", 1, "seems to be a depth network");
  network("02-onnx-one-channel/c5_unet_logits_1ch", 0, "logits, the class where above 0");
  network("02-onnx-one-channel/c6_mask_0_255", 0, "mask, the class where above 127.5");
  network("03-onnx-output-order/c7_aux_before_out", 0, "from out");
  network("03-onnx-output-order/c8_out_before_aux", 0, "from out");
  for (const char* kind : {"0_255", "0_128", "soft_rim", "one_grey_pixel", "voc15"})
    rows.push_back({std::string("04 masks_") + kind,
                    {},
                    mask + "--masks CASES/04-mask-grey-values/masks_" + kind,
                    0,
                    {std::string(kind) == "voc15" ? "dynamic where 15" : "dynamic where 128 or more"}});
  const auto with_mark = [&](const std::string& name, const std::string& command, const std::string& says) {
    rows.push_back({"05 " + name, {}, command, 0, {says}});
  };
  // The lists of the case have no images of their own: those of the sequence beside it are theirs.
  rows.push_back({"05 lists",
                  {},
                  "info CASES/" + marked + "seq",
                  0,
                  {"8 pairs of 8 colour and 8 depth images", "cannot be opened"}});
  with_mark("camera.txt", plain + "--dynamics none --camera CASES/" + marked + "cam_bom.txt",
            "8 of 8 frames tracked");
  with_mark("camera.yaml", plain + "--dynamics none --camera CASES/" + marked + "cam_bom.yaml",
            "8 of 8 frames tracked");
  with_mark("configuration", plain + "--dynamics none --config CASES/" + marked + "c_bom.toml",
            "8 of 8 frames tracked");
  with_mark("names of classes", mask + "--model CASES/" + marked + "model.onnx", "8 of 8 frames tracked");
  with_mark("trajectory",
            "eval CASES/" + marked + "trajectory_bom.txt CASES/" + marked + "trajectory_bom.txt", "ATE [m]");
  rows.push_back({"06 milliseconds",
                  {},
                  "info CASES/06-info-stamps-and-truth/milliseconds",
                  0,
                  {"not milliseconds: times 0.001", "the images' stamps times 0.001 would fit it"}});
  rows.push_back({"06 numbers",
                  {},
                  "info CASES/06-info-stamps-and-truth/numbers",
                  0,
                  {"numbers of frames? Stamps are seconds"}});
  rows.push_back({"08 depth of 8 bits",
                  {},
                  "info CASES/08-info-why-not-decoded/depth8",
                  0,
                  {"but has 8 bits and 1 channel", "not before its frames can be decoded"}});
  rows.push_back({"08 depth of three channels",
                  {},
                  "info CASES/08-info-why-not-decoded/depth16x3",
                  0,
                  {"but has 16 bits and 3 channels"}});
  const auto eval = [&](const std::string& file, std::vector<std::string> says) {
    rows.push_back({"09 " + file,
                    {},
                    "eval CASES/09-eval-all-or-nothing/" + file + " CASES/09-eval-all-or-nothing/gt.txt",
                    0,
                    std::move(says)});
  };
  eval("e13_short.txt", {"ATE [m]", "no RPE: fewer than 2 intervals of 1 s"});
  eval("e14_line.txt", {"RPE translation", "no ATE: the positions of", "lie on one line"});
  eval("e15_place.txt", {"RPE translation", "no ATE: the positions of", "are all in one place"});
  eval("e28_sparse1Hz.txt", {"ATE [m]", "no RPE: fewer than 2 intervals of 1 s"});
  rows.push_back({"11 run", {}, truth, 0, {"ATE [m]", "are left out; the first: "}});
  rows.push_back(
      {"11 info", {}, "info CASES/11-ground-truth-optional/seq", 0, {"are left out; the first: "}});
  rows.push_back({"11 convert", {}, "convert CASES/11-ground-truth-optional/seq OUT", 0, {"8 frames in "}});
  return rows;
}

}  // namespace

TEST_CASE("where nothing is masked, mapped or converted, a line says so") {
  for (const UserInput& row : std::vector<UserInput>{
           {"nothing is in range",
            [](const fs::path& root) { write_text(root / "c.toml", "[mapper.scan]\nmax_range = 0.01\n"); },
            "run SEQ --dynamics none --out OUT --config SEQ/c.toml",
            0,
            {"map: no voxel is occupied"}},
           {"a map of the room",
            {},
            "run SEQ --dynamics none --out OUT",
            0,
            {"map: nothing is masked (--dynamics none), so people and things are part of it"}},
           {"masks of other names",
            [](const fs::path& root) {
              fs::create_directories(root / "masks");
              write_image(root / "masks" / "000001.png", cv::Mat(240, 320, CV_8UC1, cv::Scalar(255)));
            },
            "run SEQ --masks SEQ/masks --out OUT",
            1,
            {"1000000.000000.png and the like are looked for, it holds 000001.png"}},
           {"masks of nothing", {}, "masks SEQ --out OUT", 0, {"none of the masks marks anything dynamic"}},
           {"depth beyond 16 bits",
            [](const fs::path& root) {
              for (const auto& file : fs::directory_iterator(root / "depth"))
                write_image(file.path(), cv::Mat::zeros(240, 320, CV_16UC1));
            },
            "convert SEQ OUT",
            0,
            {"8 of 8 depth images have no depth at all"}}})
    check_row(row);
}

TEST_CASE("inputs that people have reported are what they are, or refused in a line") {
  for (const Elsewhere& row : kElsewhere) {
    CAPTURE(row.row);
    CHECK(mentions(text_of(fs::path(DYNSLAM_SOURCE) / "tests" / row.file), std::string(row.test)));
  }
  const char* data = std::getenv("DYNSLAM_DATA");
  const fs::path cases = data == nullptr ? fs::path() : fs::path(data) / "cases";
  if (data == nullptr || !fs::exists(cases) || !dynslam::runtime::has_onnxruntime()) {
    MESSAGE("skipped: DYNSLAM_DATA names no folder with cases/, or there is no ONNX Runtime");
    return;
  }
  for (const UserInput& row : reported_cases()) check_row(row, cases);
}
