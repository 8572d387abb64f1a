// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/nets/onnx_segmenter.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <future>
#include <iterator>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "constant_onnx.hpp"
#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "dynslam/runtime/nets/segmentation_stage.hpp"
#include "dynslam/runtime/synth/synth.hpp"
#include "tiny_onnx.hpp"
#include "tum_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;
namespace fs = std::filesystem;

namespace {

/// Red person on the left, green chair, blue display, grey wall.
cv::Mat scene() {
  cv::Mat image(480, 640, CV_8UC3, cv::Scalar(128, 128, 128));
  image(cv::Rect(100, 100, 120, 300)).setTo(cv::Scalar(0, 0, 255));
  image(cv::Rect(300, 200, 100, 100)).setTo(cv::Scalar(0, 255, 0));
  image(cv::Rect(450, 50, 100, 100)).setTo(cv::Scalar(255, 0, 0));
  return image;
}

std::vector<EngineKind> engines() {
  std::vector<EngineKind> all{EngineKind::opencv};
  if (has_onnxruntime()) all.push_back(EngineKind::onnxruntime);
  return all;
}

SegmenterOptions options_for(const std::filesystem::path& model, EngineKind engine = EngineKind::automatic) {
  SegmenterOptions o;
  o.model = model;
  o.engine = engine;
  return o;
}

/// A sequence of one picture, with a wall 2 m away.
void write_sequence(const std::filesystem::path& root, int frames, const cv::Mat& colour) {
  for (const char* folder : {"rgb", "depth"}) std::filesystem::create_directories(root / folder);
  std::ofstream rgb(root / "rgb.txt"), depth(root / "depth.txt");
  for (int i = 0; i < frames; ++i) {
    const std::string stamp = std::to_string(i + 1) + ".000000";
    rgb << stamp << " rgb/" << stamp << ".png\n";
    depth << stamp << " depth/" << stamp << ".png\n";
    write_image(root / "rgb" / (stamp + ".png"), colour);
    write_image(root / "depth" / (stamp + ".png"), cv::Mat(colour.size(), CV_16UC1, cv::Scalar(10000)));
  }
}

std::string error_of(const SegmenterOptions& options) {
  try {
    const OnnxSegmenter segmenter(options);
  } catch (const std::exception& e) {
    return e.what();
  }
  return "no error";
}

}  // namespace

TEST_CASE("a network's classes arrive as masks and labels where they are, the same from every engine") {
  const test::TemporaryFolder folder;
  test::write_onnx(folder.path / "colours.onnx", test::colour_network());
  if (!has_onnxruntime()) MESSAGE("ONNX Runtime is not in this build: OpenCV alone");
  for (const EngineKind engine : engines()) {
    OnnxSegmenter segmenter(options_for(folder.path / "colours.onnx", engine));
    CAPTURE(segmenter.engine());
    CHECK(segmenter.kind() == ModelKind::semantic);
    REQUIRE(segmenter.classes().size() == 4);
    const Masks masks = segmenter.segment(scene());
    CHECK(masks.dynamic.at<std::uint8_t>(250, 160) == 255);
    CHECK(masks.dynamic.at<std::uint8_t>(250, 60) == 0);
    CHECK(masks.labels.at<std::uint8_t>(250, 160) == static_cast<int>(Label::person));
    CHECK(masks.labels.at<std::uint8_t>(250, 350) == static_cast<int>(Label::chair));
    CHECK(masks.labels.at<std::uint8_t>(100, 500) == static_cast<int>(Label::display));
    CHECK(masks.labels.at<std::uint8_t>(20, 20) == 0);
    // The input has a tenth of the width: a border lies within one of its pixels.
    CHECK(cv::countNonZero(masks.dynamic) == doctest::Approx(120 * 300).epsilon(0.1));
  }
}

TEST_CASE("names come from the metadata or a sidecar, and choose what is dynamic and what is mapped") {
  const test::TemporaryFolder folder;
  test::TinyNetwork network = test::colour_network();
  network.metadata.emplace_back("names", "{0: 'wall', 1: 'dog', 2: \"chair\", 3: 'tv'}");
  test::write_onnx(folder.path / "named.onnx", network);
  SegmenterOptions o = options_for(folder.path / "named.onnx");
  for (const EngineKind engine : engines()) {
    o = options_for(folder.path / "named.onnx", engine);
    CHECK(error_of(o).find("has no class 'person'; it has: wall, dog, chair, tv") != std::string::npos);
    o.dynamic_classes = {"dog"};
    o.map_classes = {"tv"};
    const Masks masks = OnnxSegmenter(o).segment(scene());
    CHECK(masks.dynamic.at<std::uint8_t>(250, 160) == 255);
    CHECK(masks.labels.at<std::uint8_t>(250, 350) == 0);  // chairs were not asked for
    CHECK(masks.labels.at<std::uint8_t>(100, 500) == static_cast<int>(Label::display));
    o.map_classes = {"door"};
    CHECK(error_of(o).find("has no class 'door'; it has: wall, dog, chair, tv") != std::string::npos);
  }
  // What the network says of itself comes first; FILE.names and FILE.onnx.names serve a file that says
  // nothing.
  std::ofstream(folder.path / "named.names") << "a\nb\r\nperson\nc\n";
  CHECK(error_of(options_for(folder.path / "named.onnx")).find("it has: wall, dog") != std::string::npos);
  test::write_onnx(folder.path / "bare.onnx", test::colour_network());
  o = options_for(folder.path / "bare.onnx");
  for (const char* name : {"bare.names", "bare.onnx.names"}) {
    CAPTURE(name);
    const fs::path names = folder.path / name;
    std::ofstream(names) << "a\nb\r\nperson\nc\n";
    OnnxSegmenter segmenter(o);
    CHECK(segmenter.segment(scene()).dynamic.at<std::uint8_t>(250, 350) == 255);
    CHECK(segmenter.describe().find("named by " + names.string()) != std::string::npos);
    std::ofstream(names) << "a\nb\n";
    CHECK(error_of(o).find("has 4 classes and names for 2") != std::string::npos);
    fs::remove(names);
  }
}

TEST_CASE("any class of a network gets a label of the map, beside those that the map has") {
  const test::TemporaryFolder folder;
  test::TinyNetwork network = test::colour_network();
  network.metadata.emplace_back("names", "{0: 'floor', 1: 'person', 2: 'pallet', 3: 'door'}");
  test::write_onnx(folder.path / "own.onnx", network);
  SegmenterOptions o = options_for(folder.path / "own.onnx");
  o.map_classes = {"pallet", "door"};
  const Masks first = OnnxSegmenter(o).segment(scene());
  CHECK(first.labels.at<std::uint8_t>(250, 350) == 4);
  CHECK(first.labels.at<std::uint8_t>(100, 500) == 5);
  CHECK(first.labels.at<std::uint8_t>(250, 160) == static_cast<int>(Label::person));
  o.labels.add("door");  // of a map that was loaded
  OnnxSegmenter again(o);
  const Masks then = again.segment(scene());
  CHECK(then.labels.at<std::uint8_t>(250, 350) == 5);
  CHECK(then.labels.at<std::uint8_t>(100, 500) == 4);
  CHECK(again.describe().find("dynamic: person; labels of the map: pallet (5), door (4)") !=
        std::string::npos);
}

TEST_CASE("the output that is recognised is decoded, whatever stands before it, by every engine") {
  const test::TemporaryFolder folder;
  test::TinyNetwork network = test::colour_network();
  network.before = "aux";
  test::write_onnx(folder.path / "two.onnx", network);
  for (const EngineKind engine : engines()) {
    OnnxSegmenter segmenter(options_for(folder.path / "two.onnx", engine));
    CAPTURE(segmenter.engine());
    const Masks masks = segmenter.segment(scene());
    CHECK(masks.dynamic.at<std::uint8_t>(250, 160) == 255);
    CHECK(masks.dynamic.at<std::uint8_t>(250, 60) == 0);
    CHECK(segmenter.describe().find("from out;") != std::string::npos);
  }
}

TEST_CASE("half precision, open sizes and whole numbers are decoded as float is") {
  if (!has_onnxruntime()) {
    MESSAGE("skipped: built without ONNX Runtime");
    return;
  }
  const test::TemporaryFolder folder;
  const fs::path path = folder.path / "m.onnx";
  const auto pixels = [&](const test::ConstantNetwork& network) {
    test::write_onnx(path, network);
    return cv::countNonZero(OnnxSegmenter(options_for(path)).segment(scene()).dynamic);
  };
  const std::vector<float> person = test::middle(48, 64, 1, 0);
  const int quarter = 640 * 480 / 4;
  const std::pair<std::string, std::string> names{"names", "{0: 'background', 1: 'person', 2: 'chair'}"};
  test::ConstantNetwork network{{{"out", {1, 48, 64}, person, test::kOnnxInt64}}};
  network.metadata = {names};
  CHECK(std::abs(pixels(network) - quarter) < 1000);
  network.outputs[0].type = test::kOnnxUint8;
  CHECK(std::abs(pixels(network) - quarter) < 1000);
  network.outputs[0].type = test::kOnnxHalf;
  network.input_type = test::kOnnxHalf;
  CHECK(std::abs(pixels(network) - quarter) < 1000);
  network.input = {-1, 3, -1, -1};
  network.outputs[0].shape = {1, 1, 48, 64};
  CHECK(std::abs(pixels(network) - quarter) < 1000);
  network.further_inputs = {"size"};
  test::write_onnx(path, network);
  CHECK(error_of(options_for(path)).find("has 2 inputs (image, size)") != std::string::npos);
}

TEST_CASE("YOLO with the suppression inside gives the masks of its list") {
  if (!has_onnxruntime()) {
    MESSAGE("skipped: built without ONNX Runtime");
    return;
  }
  // One person in the left half of a 64 x 48 input, one prototype that is high everywhere.
  std::vector<float> rows(300 * 8);
  const std::array<float, 8> row{0, 0, 32, 48, 0.9F, 0, 1, 0};
  std::copy(row.begin(), row.end(), rows.begin());
  std::vector<float> prototypes(2 * 12 * 16, 9.0F);
  const test::TemporaryFolder folder;
  const test::ConstantNetwork network{
      {{"output1", {1, 2, 12, 16}, prototypes}, {"output0", {1, 300, 8}, rows}}};
  test::write_onnx(folder.path / "m.onnx", network);
  OnnxSegmenter segmenter(options_for(folder.path / "m.onnx"));
  CHECK(segmenter.kind() == ModelKind::yolo);
  const Masks masks = segmenter.segment(scene());
  CHECK(cv::countNonZero(masks.dynamic) == 320 * 480);
  CHECK(masks.dynamic.at<std::uint8_t>(240, 10) == 255);
  CHECK(masks.labels.at<std::uint8_t>(240, 10) == static_cast<int>(Label::person));
}

TEST_CASE("class lists are read as exporters write them; nonsense gives none") {
  CHECK(parse_class_names("{0: 'person', 1: \"b'c\", 3: 'tv'}") ==
        std::vector<std::string>{"person", "b'c", "", "tv"});
  CHECK(parse_class_names("").empty());
  CHECK(parse_class_names("{99999999: 'x'}").empty());
  CHECK(parse_class_names("{a: 'x'}").empty());
  CHECK(parse_class_names("{0: 'open").empty());
}

TEST_CASE("a file that is no segmenter is refused in one line that names it") {
  const test::TemporaryFolder folder;
  const auto path = folder.path / "model.onnx";
  for (const EngineKind engine : engines()) {
    const SegmenterOptions o = options_for(path, engine);
    std::filesystem::remove(path);
    const auto refused = [&](const char* why) {
      const std::string message = error_of(o);
      CAPTURE(message);
      CHECK(message.find(path.string()) != std::string::npos);
      CHECK(message.find(why) != std::string::npos);
      CHECK(message.find('\n') == std::string::npos);
    };
    refused("is not a file");
    std::ofstream(path) << "";
    refused("is empty");
    std::ofstream(path) << "this is not a network at all, it is a text";
    refused("cannot be loaded");
    test::write_onnx(path, test::colour_network());
    std::filesystem::resize_file(path, std::filesystem::file_size(path) * 2 / 3);
    refused("cannot be loaded");
    test::TinyNetwork five = test::colour_network();
    five.channels = 5;
    test::write_onnx(path, five);
    refused("");
    test::TinyNetwork many = test::colour_network();
    many.weights.resize(7);
    test::write_onnx(path, many);
    refused("has 7 classes");
    test::TinyNetwork broken = test::colour_network();
    broken.weights[2][3] = std::nanf("");
    test::write_onnx(path, broken);
    refused("not finite");
  }
  if (!has_onnxruntime())
    CHECK(error_of(options_for(path, EngineKind::onnxruntime)).find("no ONNX Runtime") != std::string::npos);
}

TEST_CASE(
    "the stage gives every frame its masks, alike on its own thread and without, from network and cache") {
  const test::TemporaryFolder folder, cache;
  test::write_onnx(folder.path / "colours.onnx", test::colour_network());
  write_sequence(folder.path / "sequence", 6, scene());
  const Sequence sequence = load_sequence(folder.path / "sequence");
  const CameraConfig camera = load_camera("fr3");
  const auto run = [&](bool async, int every, const std::filesystem::path& kept) {
    FrameStream frames(sequence, camera);
    SegmentationStageOptions o;
    o.segmenter = options_for(folder.path / "colours.onnx");
    o.async = async;
    o.every = every;
    o.cache = kept;
    SegmentationStage stage(frames, o);
    std::vector<cv::Mat> masks;
    while (auto next = stage.next()) {
      REQUIRE(next->segmented.masks.has_value());
      masks.push_back(next->segmented.masks->dynamic);
    }
    return masks;
  };
  const auto sync = run(false, 1, {});
  REQUIRE(sync.size() == 6);
  CHECK(cv::countNonZero(sync[3]) > 30000);
  for (const auto& other : {run(true, 1, {}), run(true, 1, cache.path), run(true, 1, cache.path)}) {
    REQUIRE(other.size() == sync.size());
    for (std::size_t i = 0; i < sync.size(); ++i) CHECK(cv::countNonZero(other[i] != sync[i]) == 0);
  }
  const auto files = std::distance(std::filesystem::directory_iterator(cache.path), {});
  CHECK(files == 1);  // six times the same image
  CHECK(run(false, 3, {}).size() == 6);
}

TEST_CASE("runs at the same time share a folder of cached masks") {
  const test::TemporaryFolder folder, cache;
  test::write_onnx(folder.path / "colours.onnx", test::colour_network());
  write_sequence(folder.path / "sequence", 6, scene());
  const Sequence sequence = load_sequence(folder.path / "sequence");
  const CameraConfig camera = load_camera("fr3");
  const auto run = [&] {
    FrameStream frames(sequence, camera);
    SegmentationStageOptions o;
    o.segmenter = options_for(folder.path / "colours.onnx");
    o.cache = cache.path;
    SegmentationStage stage(frames, o);
    int pixels = 0;
    while (auto next = stage.next()) pixels += cv::countNonZero(next->segmented.masks->dynamic);
    return pixels;
  };
  const int alone = run();
  for (int trial = 0; trial < 5; ++trial) {
    for (const auto& entry : fs::directory_iterator(cache.path)) fs::remove(entry);
    std::vector<std::future<int>> runs;
    for (int k = 0; k < 4; ++k) runs.push_back(std::async(std::launch::async, run));
    for (auto& result : runs) CHECK(result.get() == alone);  // get() throws what the run threw
    CHECK(std::distance(fs::directory_iterator(cache.path), {}) == 1);
  }
}

TEST_CASE("threads may load networks at the same time") {
  const test::TemporaryFolder folder;
  test::write_onnx(folder.path / "colours.onnx", test::colour_network());
  for (int trial = 0; trial < 100; ++trial) {
    std::vector<std::future<std::size_t>> loads;
    for (int k = 0; k < 8; ++k) {
      loads.push_back(std::async(std::launch::async, [&] {
        return load_engine(folder.path / "colours.onnx", {EngineKind::automatic})->outputs().size();
      }));
    }
    for (auto& load : loads) CHECK(load.get() == 1);
  }
}

TEST_CASE("torchvision's Mask R-CNN answers as in torchvision: boxes, scores and masks of a small one") {
  // Made by models/export_maskrcnn.py --tiny, which also wrote what torchvision itself said of this picture.
  const auto data = std::filesystem::path(DYNSLAM_SOURCE) / "tests" / "data";
  if (!has_onnxruntime()) {
    MESSAGE("skipped: built without ONNX Runtime, and OpenCV's dnn does not load this graph");
    return;
  }
  constexpr int kWidth = 96, kHeight = 64;
  const auto grey = [](int c, int u, int v) {
    return c == 0 ? (7 * u + 3 * v) % 256 : c == 1 ? (5 * u * v / 16) % 256 : (u * u / 8 + 11 * v) % 256;
  };
  std::vector<float> input;
  for (int c = 0; c < 3; ++c) {
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) input.push_back(static_cast<float>(grey(c, u, v)) / 255.0F);
    }
  }
  const auto engine = load_engine(data / "tiny_maskrcnn.onnx", {EngineKind::onnxruntime});
  std::vector<Tensor> outputs;
  const std::vector<std::int64_t> shape{3, kHeight, kWidth};
  engine->run(input, shape, outputs);
  REQUIRE(outputs.size() == 4);
  DetectionOptions all;
  all.min_score = 0.05F;
  const auto detections =
      decode_mask_rcnn(outputs[0], outputs[1], outputs[2], outputs[3],
                       fit_letterbox(kWidth, kHeight, kWidth, kHeight), {kWidth, kHeight}, all, "tiny");
  std::ifstream golden(data / "tiny_maskrcnn.txt");
  std::string line;
  std::getline(golden, line);
  std::size_t n = 0;
  double x1, y1, x2, y2, score, mean;
  int label, area;
  for (; golden >> x1 >> y1 >> x2 >> y2 >> label >> score >> mean >> area; ++n) {
    CAPTURE(n);
    REQUIRE(n < detections.size());
    const float* box = outputs[0].data.data() + 4 * n;
    CHECK(static_cast<double>(box[0]) == doctest::Approx(x1).epsilon(1e-3));
    CHECK(static_cast<double>(box[1]) + 1 == doctest::Approx(y1 + 1).epsilon(1e-3));
    CHECK(static_cast<double>(box[2]) == doctest::Approx(x2).epsilon(1e-3));
    CHECK(static_cast<double>(box[3]) == doctest::Approx(y2).epsilon(1e-3));
    CHECK(detections[n].category == label);
    CHECK(static_cast<double>(detections[n].score) == doctest::Approx(score).epsilon(1e-3));
    CHECK(cv::countNonZero(detections[n].mask) == doctest::Approx(area).epsilon(0.01));
  }
  CHECK(n == 8);
  CHECK(detections.size() == 8);
  SegmenterOptions o = options_for(data / "tiny_maskrcnn.onnx");
  const OnnxSegmenter segmenter(o);
  CHECK(segmenter.kind() == ModelKind::mask_rcnn);
}

TEST_CASE("the demo network knows people, chairs and displays of a world that it was not trained on") {
  const auto model = std::filesystem::path(DYNSLAM_SOURCE) / "models" / "demo_segmenter.onnx";
  const test::TemporaryFolder folder;
  SynthOptions synth;
  synth.seed = 5;  // training starts at 100
  synth.frames = 4;
  synth.fps = 1;
  synthesize(synth, folder.path);
  const Sequence sequence = load_sequence(folder.path);
  const CameraConfig camera = load_camera(sequence.camera_hint);
  std::vector<cv::Mat> first;  // labels by the first engine
  for (const EngineKind engine : engines()) {
    OnnxSegmenter segmenter(options_for(model, engine));
    CAPTURE(segmenter.engine());
    std::array<double, 4> both{}, either{};
    for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
      const RgbdFrame frame = decode_frame(sequence.frames[i], i, camera);
      const cv::Mat truth = read_image(folder.path / "label" / (frame.stamp + ".png"), cv::IMREAD_UNCHANGED);
      const Masks masks = segmenter.segment(frame.bgr);
      for (int c = 1; c < 4; ++c) {
        both[static_cast<std::size_t>(c)] += cv::countNonZero((masks.labels == c) & (truth == c));
        either[static_cast<std::size_t>(c)] += cv::countNonZero((masks.labels == c) | (truth == c));
      }
      if (first.size() <= i) {
        first.push_back(masks.labels);
      } else {
        CHECK(cv::countNonZero(masks.labels != first[i]) < 100);  // of 307200: rounding decides ties
      }
    }
    CHECK(both[1] > 0.75 * either[1]);
    CHECK(both[2] > 0.6 * either[2]);
    CHECK(both[3] > 0.6 * either[3]);
  }
}
