// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/nets/mask_keeper.hpp"

#include <doctest/doctest.h>

#include <opencv2/imgproc.hpp>

#include "random.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

/// A textured person-sized block 1.5 m away that moves before a textured wall at 3 m.
struct Scene {
  cv::Mat wall = cv::Mat(480, 640, CV_8UC1), block = cv::Mat(220, 120, CV_8UC1);
  Scene() {
    test::Rng rng("mask keeper");
    for (cv::Mat* image : {&wall, &block}) {
      for (int v = 0; v < image->rows; ++v) {
        for (int u = 0; u < image->cols; ++u)
          image->at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(rng.integer(0, 255));
      }
      cv::GaussianBlur(*image, *image, {0, 0}, 2.5);
      cv::normalize(*image, *image, 0, 255, cv::NORM_MINMAX);
    }
  }
  [[nodiscard]] cv::Rect place(int frame) const { return {100 + 6 * frame, 150 + frame, 120, 220}; }
  [[nodiscard]] cv::Mat gray(int frame) const {
    cv::Mat image = wall.clone();
    block.copyTo(image(place(frame)));
    return image;
  }
  [[nodiscard]] cv::Mat depth(int frame) const {
    cv::Mat image(480, 640, CV_32FC1, cv::Scalar(3.0));
    image(place(frame)).setTo(1.5);
    return image;
  }
  [[nodiscard]] cv::Mat truth(int frame) const {
    cv::Mat mask = cv::Mat::zeros(480, 640, CV_8UC1);
    mask(place(frame)).setTo(255);
    return mask;
  }
  [[nodiscard]] Masks detected(int frame, int error) const {  // too large by `error` pixels all around
    Masks masks;
    masks.dynamic = cv::Mat::zeros(480, 640, CV_8UC1);
    masks.dynamic((place(frame) + cv::Point(-error, -error)) + cv::Size(2 * error, 2 * error)).setTo(255);
    masks.labels = masks.dynamic / 255;
    return masks;
  }
};

double iou(const cv::Mat& a, const cv::Mat& b) {
  return static_cast<double>(cv::countNonZero(a & b)) / cv::countNonZero(a | b);
}

}  // namespace

TEST_CASE("a mask with a sloppy rim is cut to the object by depth") {
  const Scene scene;
  MaskKeeper keeper;
  const Masks masks = keeper.update(scene.detected(0, 3), scene.gray(0), scene.depth(0));
  CHECK(iou(scene.detected(0, 3).dynamic, scene.truth(0)) < 0.93);
  CHECK(iou(masks.dynamic, scene.truth(0)) > 0.99);
  CHECK(masks.labels.at<std::uint8_t>(250, 150) == static_cast<int>(Label::person));
  CHECK(keeper.carried() == 0);
}

TEST_CASE("missed detections: the mask follows the object for as long as is allowed, then goes") {
  const Scene scene;
  MaskKeeperOptions options;
  options.max_age = 6;
  MaskKeeper keeper(options);
  (void)keeper.update(scene.detected(0, 0), scene.gray(0), scene.depth(0));
  for (int frame = 1; frame <= 6; ++frame) {
    CAPTURE(frame);
    // The network saw nothing, or was not asked: the same to the keeper.
    const auto nothing = frame % 2 == 0
                             ? std::optional<Masks>()
                             : std::optional<Masks>(Masks{cv::Mat::zeros(480, 640, CV_8UC1), {}, {}});
    const Masks masks = keeper.update(nothing, scene.gray(frame), scene.depth(frame));
    CHECK(keeper.carried() == 1);
    CHECK(iou(masks.dynamic, scene.truth(frame)) > 0.9);
    CHECK(masks.labels.at<std::uint8_t>(scene.place(frame).y + 100, scene.place(frame).x + 60) ==
          static_cast<int>(Label::person));
  }
  CHECK(cv::countNonZero(keeper.update(std::nullopt, scene.gray(7), scene.depth(7)).dynamic) == 0);
}

TEST_CASE("an object that has gone takes its mask along; one that is seen again is not doubled") {
  const Scene scene;
  MaskKeeper keeper;
  (void)keeper.update(scene.detected(0, 0), scene.gray(0), scene.depth(0));
  const Masks again = keeper.update(scene.detected(1, 0), scene.gray(1), scene.depth(1));
  CHECK(keeper.carried() == 0);
  CHECK(iou(again.dynamic, scene.truth(1)) > 0.98);
  const cv::Mat empty_depth(480, 640, CV_32FC1, cv::Scalar(3.0));
  CHECK(cv::countNonZero(keeper.update(std::nullopt, scene.wall, empty_depth).dynamic) == 0);
}

TEST_CASE("however long it is carried, a mask does not creep over the floor that its object stands on") {
  const Scene scene;
  MaskKeeperOptions options;
  options.max_age = 100;
  options.most_band = 9;
  MaskKeeper keeper(options);
  const cv::Mat floor(480, 640, CV_32FC1, cv::Scalar(1.6));  // as far away as the object, to 0.1 m
  cv::Mat depth = floor.clone();
  depth(scene.place(0)).setTo(1.5);
  (void)keeper.update(scene.detected(0, 0), scene.gray(0), depth);
  Masks masks;
  for (int frame = 1; frame <= 40; ++frame) masks = keeper.update(std::nullopt, scene.gray(0), depth);
  CHECK(keeper.carried() == 1);
  const int most = 2 * options.most_band;
  CHECK(cv::countNonZero(masks.dynamic) <= (120 + most + 2 * options.band) * (220 + most + 2 * options.band));
  CHECK(iou(masks.dynamic, scene.truth(0)) > 0.6);
}

TEST_CASE("a carried mask that would cover nearly everything is given up") {
  const Scene scene;
  MaskKeeper keeper;
  Masks flood;
  flood.dynamic = cv::Mat(480, 640, CV_8UC1, cv::Scalar(255));
  const cv::Mat depth(480, 640, CV_32FC1, cv::Scalar(3.0));
  (void)keeper.update(flood, scene.wall, depth);
  CHECK(cv::countNonZero(keeper.update(std::nullopt, scene.wall, depth).dynamic) == 0);
}

TEST_CASE("a copy of a keeper goes on by itself") {
  const Scene scene;
  MaskKeeper keeper;
  static_cast<void>(keeper.update(scene.detected(0, 0), scene.gray(0), scene.depth(0)));
  static_cast<void>(keeper.update(std::nullopt, scene.gray(1), scene.depth(1)));
  MaskKeeper copy = keeper;
  const Masks masks = keeper.update(std::nullopt, scene.gray(2), scene.depth(2));
  for (int frame = 10; frame < 14; ++frame)  // elsewhere
    static_cast<void>(keeper.update(scene.detected(frame, 0), scene.gray(frame), scene.depth(frame)));
  const Masks same = copy.update(std::nullopt, scene.gray(2), scene.depth(2));
  CHECK(iou(masks.dynamic, scene.truth(2)) > 0.95);
  CHECK(cv::countNonZero(masks.dynamic != same.dynamic) == 0);
}
