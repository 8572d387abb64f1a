// SPDX-License-Identifier: BSD-3-Clause
// What a network is taken for, by the outputs of one run: every kind that people export.
#include "nets/model_recognition.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/nets/model_output.hpp"

using namespace dynslam::runtime;

namespace {

struct NetworkOutput {
  std::string name;
  std::vector<std::int64_t> shape;
  bool whole = false;
};

struct NetworkRow {
  std::string name;
  std::vector<NetworkOutput> outputs;
  std::string expected;  ///< "KIND PLACE ..." of the outputs that are decoded, or a part of the error
  std::string task = "";
  cv::Size input = {640, 480};
  ModelKind asked = ModelKind::automatic;
  std::string output_name = "";
};

std::string taken_for(const NetworkRow& row) {
  std::vector<Tensor> outputs;
  for (const NetworkOutput& o : row.outputs) outputs.push_back({o.name, o.shape, {}, o.whole});
  ModelFacts facts{"m.onnx", row.asked, row.output_name, row.input, {}};
  if (!row.task.empty()) facts.metadata["task"] = row.task;
  try {
    const ModelOutputs found = recognise_outputs(outputs, facts);
    std::string text(to_string(found.kind));
    const std::size_t count = found.kind == ModelKind::semantic ? 1 : found.kind == ModelKind::yolo ? 2 : 4;
    for (std::size_t k = 0; k < count; ++k) text += " " + std::to_string(found.at[k]);
    return text;
  } catch (const InputError& e) {
    return e.what();
  }
}

std::string reading_of(const std::vector<std::vector<float>>& frames, std::size_t classes,
                       ModelOutput asked = ModelOutput::automatic) {
  try {
    ChannelReader reader(asked, classes, "m.onnx");
    for (const auto& values : frames)
      reader.look({"out", {1, 1, 1, static_cast<std::int64_t>(values.size())}, values});
    return std::string(to_string(reader.reading()));
  } catch (const InputError& e) {
    return e.what();
  }
}

}  // namespace

TEST_CASE(
    "a network is a segmenter that is decoded, by names and shapes, or refused as what it seems to be") {
  const std::vector<NetworkRow> rows{
      // Segmenters, in any order and under any name.
      {"yolo", {{"output0", {1, 116, 6300}}, {"output1", {1, 32, 120, 160}}}, "yolo 0 1"},
      {"yolo, turned round",
       {{"protos", {1, 32, 120, 160}}, {"preds", {1, 116, 6300}}},
       "yolo 1 0",
       "segment"},
      {"yolo, suppression inside",
       {{"output0", {1, 300, 38}}, {"output1", {1, 32, 120, 160}}},
       "yolo 0 1",
       "segment"},
      {"yolo, small", {{"output0", {1, 116, 84}}, {"output1", {1, 32, 16, 16}}}, "yolo 0 1", "", {64, 64}},
      {"mask r-cnn",
       {{"boxes", {3, 4}}, {"labels", {3}, true}, {"scores", {3}}, {"masks", {3, 1, 28, 28}}},
       "mask-rcnn 0 1 2 3"},
      {"mask r-cnn, nothing found, other order",
       {{"masks", {0, 1, 28, 28}}, {"scores", {0}}, {"labels", {0}, true}, {"boxes", {0, 4}}},
       "mask-rcnn 3 2 1 0"},
      {"mask r-cnn without names",
       {{"2847", {5, 4}}, {"2850", {5}, true}, {"2849", {5}}, {"2990", {5, 1, 480, 640}}},
       "mask-rcnn 0 1 2 3"},
      {"logits", {{"logits", {1, 150, 120, 160}}}, "semantic 0"},
      {"deeplab", {{"ResizeBilinear_2:0", {1, 21, 49, 65}}}, "semantic 0", "", {513, 385}},
      {"label map", {{"x", {1, 480, 640}, true}}, "semantic 0"},
      {"out and aux", {{"out", {1, 21, 480, 640}}, {"aux", {1, 21, 480, 640}}}, "semantic 0"},
      {"aux and out", {{"aux", {1, 21, 480, 640}}, {"out", {1, 21, 480, 640}}}, "semantic 1"},
      {"a head beside", {{"class", {1, 1000}}, {"seg", {1, 21, 60, 80}}}, "semantic 1"},
      {"several heads, one named",
       {{"d0", {1, 1, 480, 640}}, {"d1", {1, 1, 480, 640}}},
       "semantic 1",
       "",
       {640, 480},
       ModelKind::automatic,
       "d1"},
      // What cannot be known is asked.
      {"several heads",
       {{"d0", {1, 1, 480, 640}}, {"d1", {1, 1, 480, 640}}},
       "--model-output-name says which is"},
      {"no such head",
       {{"d0", {1, 1, 480, 640}}},
       "has no output 'd7' (--model-output-name); it has: d0",
       "",
       {640, 480},
       ModelKind::automatic,
       "d7"},
      // Everything else.
      {"yolo detector", {{"output0", {1, 84, 6300}}}, "seems to be a YOLO detector: boxes without masks"},
      {"yolo detector, by metadata",
       {{"output0", {1, 84, 6300}}},
       "seems to be a detector (task 'detect'",
       "detect"},
      {"yolo pose", {{"output0", {1, 56, 6300}}}, "seems to be a YOLO pose network"},
      {"yolo pose, by metadata", {{"output0", {1, 56, 6300}}}, "task 'pose'", "pose"},
      {"yolo obb", {{"output0", {1, 20, 6300}}}, "task 'obb'", "obb"},
      {"yolo classify", {{"output0", {1, 1000}}}, "task 'classify'", "classify"},
      {"yolov5", {{"output0", {1, 18900, 85}}}, "YOLOv5 or YOLOv7 detector"},
      {"yolov5-seg",
       {{"output0", {1, 18900, 117}}, {"output1", {1, 32, 120, 160}}},
       "YOLOv5 or YOLOv7 segmenter, whose anchors are not decoded"},
      {"end to end", {{"output0", {1, 300, 6}}}, "a detector whose suppression is inside"},
      {"yolov7 end to end", {{"output", {12, 7}}}, "a detector whose suppression is inside"},
      {"rt-detr", {{"output0", {1, 300, 84}}}, "a detector of the DETR kind"},
      {"detr", {{"pred_logits", {1, 100, 92}}, {"pred_boxes", {1, 100, 4}}}, "a detector of the DETR kind"},
      {"detr for segmentation",
       {{"pred_logits", {1, 100, 251}}, {"pred_boxes", {1, 100, 4}}, {"pred_masks", {1, 100, 120, 160}}},
       "DETR or MaskFormer kind, whose queries are not decoded"},
      {"maskformer",
       {{"class_queries_logits", {1, 100, 134}}, {"masks_queries_logits", {1, 100, 120, 160}}},
       "DETR or MaskFormer kind, whose queries are not decoded"},
      {"maskformer without names", {{"a", {1, 100, 134}}, {"b", {1, 100, 120, 160}}}, "seems to be"},
      {"faster r-cnn",
       {{"boxes", {3, 4}}, {"labels", {3}, true}, {"scores", {3}}},
       "a detector: boxes without masks"},
      {"tensorrt's suppression",
       {{"num_dets", {1, 1}}, {"det_boxes", {1, 100, 4}}, {"det_scores", {1, 100}}},
       "a detector: boxes without masks"},
      {"depth anything", {{"predicted_depth", {1, 480, 640}}}, "seems to be a depth network"},
      {"disparity", {{"disp_0", {1, 1, 480, 640}}}, "seems to be a depth network"},
      {"heat maps", {{"heatmaps", {1, 17, 120, 160}}}, "seems to be a pose network"},
      {"simcc", {{"simcc_x", {1, 17, 384}}, {"simcc_y", {1, 17, 512}}}, "seems to be a pose network"},
      {"classifier", {{"logits", {1, 1000}}}, "seems to be a classifier"},
      {"an image of channels last", {{"out", {1, 480, 640, 21}}}, "seems to be of no kind that is known"},
      {"nothing", {}, "seems to be of no kind that is known"},
      {"not of the kind that was said",
       {{"out", {1, 21, 480, 640}}},
       "not --model-kind yolo",
       "",
       {640, 480},
       ModelKind::yolo},
      {"a detector said to be semantic",
       {{"output0", {1, 84, 6300}}},
       "a YOLO detector: boxes without masks, not "
       "--model-kind semantic",
       "",
       {640, 480},
       ModelKind::semantic}};
  for (const NetworkRow& row : rows) {
    CAPTURE(row.name);
    const std::string found = taken_for(row);
    CAPTURE(found);
    const bool refused = row.expected.rfind("yolo ", 0) != 0 && row.expected.rfind("mask-rcnn ", 0) != 0 &&
                         row.expected.rfind("semantic ", 0) != 0;
    if (!refused) {
      CHECK(found == row.expected);
      continue;
    }
    CHECK(found.rfind("m.onnx: ", 0) == 0);
    CHECK(found.find(row.expected) != std::string::npos);
    CHECK(found.find('\n') == std::string::npos);
  }
}

TEST_CASE("the only channel of a network is read by its values, or refused") {
  std::vector<float> depth, probability, soft, unsure;
  for (int i = 0; i < 100; ++i) {
    const auto x = static_cast<float>(i);
    depth.push_back(0.7F + 0.05F * x);
    probability.push_back(1 / (1 + std::exp(15.3F - 0.3F * x)));
    soft.push_back(255 / (1 + std::exp(15.3F - 0.5F * x)));
    unsure.push_back(0.2F + 0.006F * x);
  }
  struct Row {
    std::string name;
    std::vector<std::vector<float>> frames;
    std::size_t classes;
    std::string expected;
  };
  const std::vector<Row> rows{
      {"logits", {{-8, 8, 3, -2}}, 2, "logits"},
      {"logits, nobody there", {{-8, -7, -3, -2}}, 0, "logits"},
      {"probability", {probability}, 2, "probability"},
      {"probability of half precision", {{0, 1.0004F, 0.01F, 0.98F}}, 1, "probability"},
      {"0 and 255", {{0, 255, 0, 255}}, 2, "mask"},
      {"0 to 255 with rims", {soft}, 1, "mask"},
      {"labels", {{0, 15, 3, 20}}, 21, "labels"},
      {"0 and 1", {{0, 1, 0, 1}}, 2, "labels"},
      {"0 and 1 without names", {{0, 1, 0, 1}}, 0, "probability"},
      {"zeros say nothing", {{0, 0, 0, 0}}, 2, "auto"},
      {"zeros, then a mask", {{0, 0, 0, 0}, {0, 255, 255, 0}}, 2, "mask"},
      {"depth", {depth}, 2, "perhaps depth"},
      {"depth with names", {depth}, 80, "perhaps depth"},
      {"nothing near 0 or 1", {unsure}, 2, "--model-output"},
      {"labels beyond the classes", {{0, 15, 3, 37}}, 21, "which are no labels of its 21 classes"},
      {"255 among many classes", {{0, 15, 3, 255}}, 21, "no labels of its 21 classes"},
      {"labels without names", {{0, 15, 3, 20}}, 0, "one name per line"},
      {"labels, then depth", {{0, 15, 3, 20}, depth}, 21, "not labels of 21 classes as in the frames before"},
      {"probability, then 255", {probability, {0, 255}}, 2, "not probabilities as in the frames before"}};
  for (const Row& row : rows) {
    CAPTURE(row.name);
    const std::string found = reading_of(row.frames, row.classes);
    CAPTURE(found);
    CHECK(found.find(row.expected) != std::string::npos);
    CHECK((found.rfind("m.onnx: ", 0) == 0) ==
          (row.expected.find(' ') != std::string::npos || row.expected == "--model-output"));
  }
  CHECK(reading_of({depth}, 2, ModelOutput::mask) == "mask");  // whoever says so is believed
  CHECK(reading_of({depth}, 2, ModelOutput::probability).find("not probabilities as --model-output says") !=
        std::string::npos);
  CHECK(*ChannelReader(ModelOutput::logits, 0, "").threshold() == 0.0F);
  CHECK(*ChannelReader(ModelOutput::probability, 0, "").threshold() == 0.5F);
  CHECK(*ChannelReader(ModelOutput::mask, 0, "").threshold() == 127.5F);
  CHECK_FALSE(ChannelReader(ModelOutput::labels, 0, "").threshold());
}

TEST_CASE("channels from 0 to 1 that do not add up are heat maps; shares and logits are not") {
  const auto map = [](std::vector<float> values) { return Tensor{"out", {1, 2, 1, 2}, std::move(values)}; };
  CHECK(are_heatmaps(map({0.1F, 0.0F, 0.05F, 0.2F})));
  CHECK_FALSE(are_heatmaps(map({0.3F, 0.9F, 0.7F, 0.1F})));
  CHECK_FALSE(are_heatmaps(map({-3, 2, 0.2F, 0.1F})));
}

TEST_CASE("an input that is not one image is refused by what it is") {
  const auto error = [](std::vector<TensorInfo> inputs) {
    try {
      (void)input_shape(inputs, {640, 480}, "m.onnx");
    } catch (const InputError& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  CHECK(input_shape({{"x", {-1, 3, -1, -1}, 1}}, {640, 480}, "m") ==
        std::vector<std::int64_t>{1, 3, 480, 640});
  CHECK(input_shape({{"x", {3, 320, 416}, 10}}, {640, 480}, "m") == std::vector<std::int64_t>{3, 320, 416});
  CHECK(error({{"images", {1, 3, 48, 64}, 1}, {"orig_target_sizes", {1, 2}, 7}})
            .find("has 2 inputs (images, orig_target_sizes)") != std::string::npos);
  CHECK(error({{"x", {4, 3, 48, 64}, 1}}).find("takes 4 images at once") != std::string::npos);
  CHECK(error({{"x", {1, 480, 640, 3}, 1}}).find("channels last") != std::string::npos);
  CHECK(error({{"x", {1, 1, 48, 64}, 1}}).find("not one image of 3 x height x width") != std::string::npos);
  CHECK(error({{"x", {1, 3, 48, 64}, 2}}).find("type uint8") != std::string::npos);
  CHECK(error({{"x", {1, 3, 4, 4}, 1}}).find("takes images of 4 x 4") != std::string::npos);
}
