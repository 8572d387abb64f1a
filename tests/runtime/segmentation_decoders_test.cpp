// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/nets/segmentation_decoders.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>

#include "dynslam/runtime/error.hpp"
#include "random.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

const cv::Size kImage(640, 480);

/// Two classes, two prototypes (left half, right half of the input) on a 416 x 320 input.
struct YoloCase {
  Tensor predictions{"output0", {1, 8, 3}, std::vector<float>(24, 0.0F)};
  Tensor prototypes{"output1", {1, 2, 80, 104}, std::vector<float>(2 * 80 * 104, -10.0F)};
  Letterbox fit = fit_letterbox(640, 480, 416, 320);

  YoloCase() {
    for (int v = 0; v < 80; ++v) {
      for (int u = 0; u < 104; ++u)
        prototypes.data[static_cast<std::size_t>((u < 52 ? 0 : 80) * 104 + v * 104 + u)] = 10.0F;
    }
  }
  void set(int n, float x, float y, float w, float h, float score0, float score1, float c0, float c1) {
    const float column[8] = {x, y, w, h, score0, score1, c0, c1};
    for (int r = 0; r < 8; ++r) predictions.data[static_cast<std::size_t>(r * 3 + n)] = column[r];
  }
  [[nodiscard]] std::vector<Detection> decode(const DetectionOptions& o = {}) const {
    return decode_yolo(predictions, prototypes, fit, kImage, o, "m.onnx");
  }
};

bool refused(const auto& f, const char* why) {
  try {
    (void)f();
  } catch (const InputError& e) {
    CAPTURE(e.what());
    return std::string(e.what()).find("m.onnx") != std::string::npos &&
           std::string(e.what()).find(why) != std::string::npos;
  }
  return false;
}

}  // namespace

TEST_CASE("a letterbox keeps the picture's shape and is undone by the decoder") {
  const Letterbox fit = fit_letterbox(640, 480, 416, 320);
  CHECK(fit.scale_x == doctest::Approx(0.65));
  CHECK(fit.scale_y == fit.scale_x);
  CHECK(fit.pad_x == 0);
  CHECK(fit.pad_y == 4);
  const Letterbox wide = fit_letterbox(480, 640, 416, 320);
  CHECK(wide.scale_x == doctest::Approx(0.5));
  CHECK(wide.pad_x == 88);
}

TEST_CASE("YOLO: boxes, classes and masks land on the image; weak and doubled ones are dropped") {
  YoloCase c;
  // In the image: centre (320, 240), 200 x 100. In the input: times 0.65, 4 down.
  c.set(0, 208, 160, 130, 65, 0.1F, 0.9F, 1, 0);
  c.set(1, 210, 161, 130, 65, 0.1F, 0.8F, 1, 0);  // the same again, weaker
  c.set(2, 208, 160, 130, 65, 0.5F, 0.2F, 0, 1);  // another class in the same place
  const auto found = c.decode();
  REQUIRE(found.size() == 2);
  CHECK(found[0].category == 1);
  CHECK(static_cast<double>(found[0].score) == doctest::Approx(0.9).epsilon(1e-5));
  CHECK(std::abs(found[0].box.x - 220) <= 1);
  CHECK(std::abs(found[0].box.y - 190) <= 1);
  CHECK(std::abs(found[0].box.width - 200) <= 2);
  CHECK(std::abs(found[0].box.height - 100) <= 2);
  CHECK(found[0].mask.size() == found[0].box.size());
  CHECK(found[0].mask.at<std::uint8_t>(50, 50) == 255);  // the left half
  CHECK(found[0].mask.at<std::uint8_t>(50, 150) == 0);
  CHECK(found[1].category == 0);
  CHECK(found[1].mask.at<std::uint8_t>(50, 50) == 0);
  CHECK(found[1].mask.at<std::uint8_t>(50, 150) == 255);
  DetectionOptions strict;
  strict.min_score = 0.95F;
  CHECK(c.decode(strict).empty());
}

TEST_CASE("YOLO: boxes that leave the image are cut, those outside vanish") {
  YoloCase c;
  c.set(0, 0, 0, 100, 100, 0.9F, 0, 1, 0);
  c.set(1, -500, 100, 50, 50, 0.9F, 0, 1, 0);
  c.set(2, 200, 100, -5, 50, 0.9F, 0, 1, 0);
  const auto found = c.decode();
  REQUIRE(found.size() == 1);
  CHECK((found[0].box & cv::Rect({0, 0}, kImage)) == found[0].box);
}

TEST_CASE("Mask R-CNN: masks of box size and of image size say the same") {
  const Letterbox fit = fit_letterbox(640, 480, 640, 480);
  Tensor boxes{"boxes", {2, 4}, {100, 50, 300, 250, 10, 10, 20, 20}}, labels{"labels", {2}, {1, 3}},
      scores{"scores", {2}, {0.9F, 0.1F}};
  Tensor small{"masks", {2, 1, 28, 28}, std::vector<float>(2 * 28 * 28, 0.0F)};
  for (int v = 0; v < 28; ++v) {
    for (int u = 0; u < 14; ++u) small.data[static_cast<std::size_t>(v * 28 + u)] = 1;
  }
  const auto a = decode_mask_rcnn(boxes, labels, scores, small, fit, kImage, {}, "m.onnx");
  REQUIRE(a.size() == 1);
  CHECK(a[0].category == 1);
  CHECK(a[0].box == cv::Rect(100, 50, 200, 200));
  CHECK(cv::countNonZero(a[0].mask) == doctest::Approx(200 * 100).epsilon(0.03));
  CHECK(a[0].mask.at<std::uint8_t>(100, 50) == 255);
  Tensor whole{"masks", {2, 1, 480, 640}, std::vector<float>(2 * 480 * 640, 0.0F)};
  for (int v = 50; v < 250; ++v) {
    for (int u = 100; u < 200; ++u) whole.data[static_cast<std::size_t>(v * 640 + u)] = 1;
  }
  const auto b = decode_mask_rcnn(boxes, labels, scores, whole, fit, kImage, {}, "m.onnx");
  REQUIRE(b.size() == 1);
  CHECK(cv::countNonZero(a[0].mask != b[0].mask) < 200 * 8);
  Tensor none_boxes{"boxes", {0, 4}, {}}, none{"labels", {0}, {}}, no_masks{"masks", {0, 1, 28, 28}, {}};
  CHECK(decode_mask_rcnn(none_boxes, none, none, no_masks, fit, kImage, {}, "m.onnx").empty());
}

TEST_CASE(
    "semantic: logits are interpolated before the strongest is taken, in either convention; label maps are "
    "copied") {
  // Class 1 rises linearly from left to right, class 0 is its mirror image: they meet in the middle.
  for (const bool align : {true, false}) {
    Tensor logits{"out", {1, 2, 25, 33}, std::vector<float>(2 * 25 * 33)};
    for (int v = 0; v < 25; ++v) {
      for (int u = 0; u < 33; ++u) {
        logits.data[static_cast<std::size_t>(v * 33 + u)] = static_cast<float>(32 - u);
        logits.data[static_cast<std::size_t>(25 * 33 + v * 33 + u)] = static_cast<float>(u);
      }
    }
    const cv::Mat labels =
        decode_semantic(logits, fit_stretched(640, 480, 513, 385), kImage, align, "m.onnx");
    CHECK(labels.size() == kImage);
    const int ones = cv::countNonZero(labels.row(240));
    CHECK(std::abs(ones - 320) <= 1);
    CHECK(labels.at<std::uint8_t>(240, 318) == 0);
    CHECK(labels.at<std::uint8_t>(240, 321) == 1);
  }
  Tensor map{"out", {1, 48, 64}, std::vector<float>(48 * 64, 0.0F)};
  map.data[10 * 64 + 20] = 7;
  const cv::Mat labels = decode_semantic(map, fit_stretched(640, 480, 64, 48), kImage, false, "m.onnx");
  CHECK(cv::countNonZero(labels == 7) == 100);
  CHECK(labels.at<std::uint8_t>(105, 205) == 7);
}

TEST_CASE("wrong shapes and values that are not finite are refused by name") {
  YoloCase c;
  c.predictions.data[5] = std::numeric_limits<float>::quiet_NaN();
  CHECK(refused([&] { return c.decode(); }, "not finite"));
  YoloCase few;
  few.predictions.shape = {1, 5, 3};
  CHECK(refused([&] { return few.decode(); }, "output0"));
  YoloCase flat;
  flat.prototypes.shape = {2, 80, 104};
  CHECK(refused([&] { return flat.decode(); }, "output1"));
  const Tensor logits{"out", {1, 300, 4, 4}, std::vector<float>(300 * 16)};
  CHECK(refused(
      [&] { return decode_semantic(logits, fit_stretched(640, 480, 64, 48), kImage, false, "m.onnx"); },
      "255"));
  const Tensor lie{"out", {1, 2, 1000, 1000}, std::vector<float>(10)};
  CHECK(
      refused([&] { return decode_semantic(lie, fit_stretched(640, 480, 64, 48), kImage, false, "m.onnx"); },
              "10 values"));
}

TEST_CASE("any tensor is decoded or refused: boxes stay inside, masks fit their boxes") {
  test::Rng rng("decoder fuzz");
  INFO("seed ", rng.seed());
  const auto any = [&](float low, float high) {
    if (rng.chance(0.002)) return rng.chance(0.5) ? std::numeric_limits<float>::infinity() : 1e30F;
    return static_cast<float>(rng.uniform(static_cast<double>(low), static_cast<double>(high)));
  };
  int decoded = 0, refusals = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const auto P = rng.integer(0, 4), classes = rng.integer(0, 5), n = rng.integer(0, 30),
               h = rng.integer(0, 12), w = rng.integer(0, 12);
    Tensor predictions{"output0", {1, 4 + P + classes, n}, {}}, prototypes{"output1", {1, P, h, w}, {}};
    for (int k = 0; k < (4 + P + classes) * n; ++k)
      predictions.data.push_back(any(-1, 2) * (k < 4 * n ? 300.0F : 1.0F));
    for (int k = 0; k < P * h * w; ++k) prototypes.data.push_back(any(-5, 5));
    Tensor boxes{"boxes", {n, 4}, {}}, labels{"labels", {n}, {}}, scores{"scores", {n}, {}},
        masks{"masks", {n, 1, h, w}, {}};
    for (int k = 0; k < 4 * n; ++k) boxes.data.push_back(any(-100, 700));
    for (int k = 0; k < n; ++k) labels.data.push_back(any(rng.chance(0.01) ? -3 : 0, 100));
    for (int k = 0; k < n; ++k) scores.data.push_back(any(0, 1));
    for (int k = 0; k < n * h * w; ++k) masks.data.push_back(any(0, 1));
    const Letterbox fit = fit_letterbox(640, 480, rng.integer(32, 640), rng.integer(32, 640));
    const auto check = [&](const auto& f) {
      try {
        for (const Detection& d : f()) {
          CHECK((d.box & cv::Rect({0, 0}, kImage)) == d.box);
          CHECK(d.box.area() > 0);
          CHECK(d.mask.size() == d.box.size());
          CHECK(d.mask.type() == CV_8UC1);
        }
        ++decoded;
      } catch (const InputError&) {
        ++refusals;
      }
    };
    check([&] { return decode_yolo(predictions, prototypes, fit, kImage, {}, "m.onnx"); });
    check([&] { return decode_mask_rcnn(boxes, labels, scores, masks, fit, kImage, {}, "m.onnx"); });

    const auto channels = rng.integer(0, 5);
    Tensor dense{"out", {1, channels, h, w}, {}};
    if (channels == 1 && rng.chance(0.5)) dense.shape = {1, h, w};  // labels instead of logits
    for (int k = 0; k < channels * h * w; ++k) dense.data.push_back(any(-3, 300));
    try {
      const cv::Mat map = decode_semantic(dense, fit, kImage, rng.chance(0.5), "m.onnx");
      CHECK(map.size() == kImage);
      CHECK(map.type() == CV_8UC1);
      ++decoded;
    } catch (const InputError&) {
      ++refusals;
    }
  }
  CHECK(decoded > 50);
  CHECK(refusals > 50);
}
