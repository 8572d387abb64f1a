// SPDX-License-Identifier: BSD-3-Clause
// Nothing is taken for something else: networks and mask files of every kind, what the program says of each,
// and that a run in which nothing was masked says so.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <string>
#include <vector>

#include "constant_onnx.hpp"
#include "dynslam/runtime/nets/inference_engine.hpp"
#include "mask_files.hpp"
#include "program.hpp"
#include "tum_fixture.hpp"

using dynslam::test::call, dynslam::test::ProgramResult;
namespace fs = std::filesystem;

namespace {

using dynslam::test::ConstantNetwork, dynslam::test::middle;

const cv::Size kSequenceSize(320, 240);

/// Two frames, made by the program once for all tests of this file.
const fs::path& two_frames() {
  static const dynslam::test::TemporaryFolder folder;
  static const fs::path path = [] {
    const fs::path made = folder.path / "s";
    REQUIRE(call("synth " + made.string() + " --frames 2 --path xyz --walkers 1 --size 320x240").code == 0);
    return made;
  }();
  return path;
}

struct RunOfMasks {
  ProgramResult program;
  std::optional<double> covered;  ///< share of the pixels of all masks that were written; nullopt: none were
};

/// Runs the sequence with the a-priori masks as they are.
RunOfMasks run_with(const fs::path& sequence, const std::string& arguments) {
  const dynslam::test::TemporaryFolder out;
  RunOfMasks run{call("run " + sequence.string() + " --out " + out.path.string() +
                      " --no-map --dynamics semantic --keep-masks false --save-masks -v " + arguments),
                 {}};
  if (run.program.code != 0) return run;
  double marked = 0, pixels = 0;
  for (const auto& file : fs::directory_iterator(out.path / "masks")) {
    const cv::Mat mask = dynslam::runtime::read_image(file.path(), cv::IMREAD_UNCHANGED);
    marked += cv::countNonZero(mask);
    pixels += static_cast<double>(mask.total());
  }
  run.covered = marked / pixels;
  return run;
}

/// The rule for all: an error is one line; where nothing was masked, a line says so.
void check_never_silent(const RunOfMasks& run) {
  const std::string& out = run.program.out;
  if (run.program.code != 0) {
    CHECK((run.program.code == 1 || run.program.code == 2));
    CHECK(std::count(out.begin(), out.end(), '\n') == 1);
    CHECK(out.rfind("dynslam: error: ", 0) == 0);
  } else if (*run.covered == 0) {
    CHECK(out.find("no a-priori mask marks anything dynamic in any of ") != std::string::npos);
  } else {
    CHECK(out.find("no a-priori mask marks anything") == std::string::npos);
  }
}

struct NetworkCase {
  std::string name;
  ConstantNetwork network;
  std::string arguments;
  double covered;  ///< share of the pixels; -1: refused
  std::string line;
};

std::vector<NetworkCase> networks() {
  const std::pair<std::string, std::string> person{"names", "{0: 'background', 1: 'person'}"},
      many{"names", "{0: 'person', 1: 'bicycle', 2: 'car', 3: 'cat'}"}, detect{"task", "detect"};
  const auto one = [&](std::vector<float> values,
                       const std::vector<std::pair<std::string, std::string>>& metadata) {
    ConstantNetwork network{{{"output", {1, 1, 48, 64}, std::move(values)}}};
    network.metadata = metadata;
    return network;
  };
  const auto with = [](std::vector<dynslam::test::ConstantOutput> outputs,
                       const std::vector<std::pair<std::string, std::string>>& metadata) {
    ConstantNetwork network{std::move(outputs)};
    network.metadata = metadata;
    return network;
  };
  std::vector<float> depth, classes = middle(48, 64, -5, 5);
  for (int i = 0; i < 48 * 64; ++i) depth.push_back(0.8F + 0.001F * static_cast<float>(i));
  const std::vector<float> there = middle(48, 64, 5, -5);
  classes.insert(classes.end(), there.begin(), there.end());
  std::vector<float> turned = middle(48, 64, 5, -5);
  const std::vector<float> away = middle(48, 64, -5, 5);
  turned.insert(turned.end(), away.begin(), away.end());
  return {
      {"yolo detector", with({{"output0", {1, 8, 84}, {}}}, {many}), "", -1, "seems to be "},
      {"yolo detector by its task", with({{"output0", {1, 8, 84}, {}}}, {many, detect}), "", -1,
       "a detector (task 'detect' in its metadata)"},
      {"suppression inside", with({{"output0", {1, 300, 6}, {}}}, {many}), "", -1,
       "whose suppression is inside"},
      {"rt-detr", with({{"output0", {1, 300, 8}, {}}}, {many}), "", -1, "of the DETR kind"},
      {"depth by name", with({{"predicted_depth", {1, 48, 64}, depth}}, {many}), "", -1, "a depth network"},
      {"depth by values", one(depth, {person}), "", -1, "perhaps depth"},
      {"depth by values of many classes", one(depth, {many}), "", -1, "values from 0.8 to 3.871"},
      {"logits", one(middle(48, 64, 8, -8), {person}), "", 0.25,
       "logits, the class where above 0 (values from -8 to 8)"},
      {"logits, nobody there", one(middle(48, 64, -2, -8), {person}), "", 0, "logits"},
      {"probability", one(middle(48, 64, 0.97F, 0.02F), {}), "", 0.25,
       "probability, the class where above 0.5"},
      {"0 and 255", one(middle(48, 64, 255, 0), {person}), "", 0.25, "mask, the class where above 127.5"},
      {"labels", one(middle(48, 64, 0, 3), {many}), "", 0.25, "labels (values from 0 to 3)"},
      {"zeros", one(middle(48, 64, 0, 0), {person}), "", 0, "zeros alone"},
      {"labels beyond the classes", one(middle(48, 64, 0, 9), {many}), "", -1, "no labels of its 4 classes"},
      {"unsure", one(middle(48, 64, 0.6F, 0.4F), {person}), "", -1,
       "--model-output labels, logits, probability or mask"},
      {"unsure, said", one(middle(48, 64, 0.6F, 0.4F), {person}), "--model-output probability", 0.25,
       "probability, the class where above 0.5 (--model-output)"},
      {"said wrongly", one(middle(48, 64, 8, -8), {person}), "--model-output mask", -1,
       "not grey values of a mask as --model-output says"},
      {"aux, out", with({{"aux", {1, 2, 48, 64}, turned}, {"out", {1, 2, 48, 64}, classes}}, {person}), "",
       0.25, "from out; 2 classes named by its metadata"},
      {"out, aux", with({{"out", {1, 2, 48, 64}, classes}, {"aux", {1, 2, 48, 64}, turned}}, {person}), "",
       0.25, "from out; 2 classes named by its metadata"},
      {"two heads", with({{"a", {1, 2, 48, 64}, turned}, {"b", {1, 2, 48, 64}, classes}}, {person}), "", -1,
       "--model-output-name says which is"},
      {"two heads, said", with({{"a", {1, 2, 48, 64}, turned}, {"b", {1, 2, 48, 64}, classes}}, {person}),
       "--model-output-name b", 0.25, "from b; 2 classes"},
      {"no names", with({{"x", {1, 2, 48, 64}, classes}}, {}), "", -1, "has 2 classes and names for 0"}};
}

}  // namespace

TEST_CASE("a network is what it is, or refused in a line; a run that masks nothing says so") {
  if (!dynslam::runtime::has_onnxruntime()) {
    MESSAGE("skipped: built without ONNX Runtime, and OpenCV's dnn does not load these graphs");
    return;
  }
  const dynslam::test::TemporaryFolder folder;
  const fs::path model = folder.path / "m.onnx";
  for (const NetworkCase& c : networks()) {
    CAPTURE(c.name);
    dynslam::test::write_onnx(model, c.network);
    const RunOfMasks run = run_with(two_frames(), "--model " + model.string() + " " + c.arguments);
    CAPTURE(run.program.out);
    CHECK(run.covered.has_value() == (c.covered >= 0));
    if (run.covered && c.covered >= 0) CHECK(*run.covered == doctest::Approx(c.covered).epsilon(0.05));
    CHECK(run.program.out.find(c.line) != std::string::npos);
    check_never_silent(run);
  }
}

TEST_CASE("mask files are what they are, or refused in a line; a run that masks nothing says so") {
  for (const dynslam::test::MaskFiles& kind : dynslam::test::every_kind_of_mask()) {
    CAPTURE(kind.name);
    const dynslam::test::TemporaryFolder folder;
    for (const auto& frame : fs::directory_iterator(two_frames() / "rgb"))
      kind.write(folder.path / frame.path().filename(), kSequenceSize);
    std::string labels;
    for (const std::string& label : kind.labels) labels += (labels.empty() ? " --mask-labels " : ",") + label;
    const RunOfMasks run = run_with(two_frames(), "--masks " + folder.path.string() + labels);
    CAPTURE(run.program.out);
    CHECK(run.covered.has_value() == (kind.boxes >= 0));
    const double expected = kind.name == "a palette that begins with white" ? 14.0 / 16 : kind.boxes / 16.0;
    if (run.covered && kind.boxes >= 0) CHECK(*run.covered == doctest::Approx(expected).epsilon(0.03));
    CHECK(run.program.out.find(kind.line) != std::string::npos);
    check_never_silent(run);
  }
}

TEST_CASE("an own class has its name in the map, in all that is made of it, and in the next session") {
  const dynslam::test::TemporaryFolder folder;
  const std::string at = folder.path.string();
  fs::create_directories(folder.path / "masks");
  for (const auto& frame : fs::directory_iterator(two_frames() / "rgb")) {
    dynslam::runtime::write_image(folder.path / "masks" / frame.path().filename(),
                                  dynslam::test::two_boxes(kSequenceSize, CV_8UC1, 40, 50));
  }
  const std::string run = "run " + two_frames().string() + " --dynamics semantic --masks " + at + "/masks ";
  REQUIRE(call(run + "--mask-labels 40=person,50=pallet --save-map " + at + "/map --out " + at + "/a").code ==
          0);
  const auto info = nlohmann::json::parse(call("map info --json " + at + "/a/map.sot").out);
  REQUIRE(info["classes"].contains("pallet"));
  CHECK(info["classes"]["pallet"]["label"] == 4);
  CHECK(call("map info " + at + "/a/map.sot").out.find("pallet") != std::string::npos);
  CHECK(call("map export " + at + "/a/map.sot " + at + "/a.ply").code == 0);
  std::ifstream ply(folder.path / "a.ply");
  const std::string text(std::istreambuf_iterator<char>(ply), {});
  CHECK(text.find("comment label 4 pallet\n") != std::string::npos);
  // Another session of the same map: the label that it has stays, a new class gets the next one.
  const std::string next = run + "--load-map " + at + "/map --out " + at + "/b ";
  REQUIRE(call(next + "--mask-labels 40=person,50=door").code == 0);
  const auto later = nlohmann::json::parse(call("map info --json " + at + "/b/map.sot").out);
  CHECK(later["classes"]["pallet"]["label"] == 4);
  dynslam::test::check_one_line_error(
      run + "--mask-labels 40=person,50=a,51=b,52=c,53=d,54=e --out " + at + "/c", 2,
      "no label left for the class 'e'");
}

TEST_CASE("networks and masks that users have reported are refused or masked as they should be") {
  const char* data = std::getenv("DYNSLAM_DATA");
  const fs::path cases = data == nullptr ? fs::path() : fs::path(data) / "cases";
  if (data == nullptr || !fs::exists(cases / "04-mask-grey-values") || !dynslam::runtime::has_onnxruntime()) {
    MESSAGE("skipped: DYNSLAM_DATA names no folder with cases/, or there is no ONNX Runtime");
    return;
  }
  const fs::path sequence = cases / "04-mask-grey-values" / "seq";
  struct Case {
    std::string file;
    double covered;  ///< -1: refused
  };
  const std::vector<Case> all{{"01-onnx-not-a-segmenter/c1_yolo_detect_1x84xN.onnx", -1},
                              {"01-onnx-not-a-segmenter/c3_rtdetr_1x300x84.onnx", -1},
                              {"01-onnx-not-a-segmenter/c4_yolo_end2end_1x300x6.onnx", -1},
                              {"01-onnx-not-a-segmenter/d2_depth_net.onnx", -1},
                              {"02-onnx-one-channel/c5_unet_logits_1ch.onnx", 0.173},  // with its rim above 0
                              {"02-onnx-one-channel/c6_mask_0_255.onnx", 0.156},
                              {"03-onnx-output-order/c7_aux_before_out.onnx", 0.167},
                              {"03-onnx-output-order/c8_out_before_aux.onnx", 0.167},
                              {"04-mask-grey-values/masks_0_255", 0.236},
                              {"04-mask-grey-values/masks_0_128", 0.236},
                              {"04-mask-grey-values/masks_soft_rim", 0.236},
                              {"04-mask-grey-values/masks_voc15", 0.236},
                              {"04-mask-grey-values/masks_one_grey_pixel", 0.236}};
  for (const Case& c : all) {
    CAPTURE(c.file);
    const bool network = fs::path(c.file).extension() == ".onnx";
    const RunOfMasks run =
        run_with(sequence, (network ? "--model " : "--masks ") + (cases / c.file).string());
    CAPTURE(run.program.out);
    CHECK(run.covered.has_value() == (c.covered >= 0));
    if (run.covered && c.covered >= 0) CHECK(*run.covered == doctest::Approx(c.covered).epsilon(0.01));
    check_never_silent(run);
  }
}
