// SPDX-License-Identifier: BSD-3-Clause
#include "slam/input_check.hpp"

#include <fmt/format.h>

#include <cmath>
#include <opencv2/core/check.hpp>
#include <string>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/slam/feature_extractor.hpp"

namespace dynslam::runtime {
namespace {

std::string describe(int width, int height, int type) {
  return fmt::format("{}x{} {}", width, height, cv::typeToString(type));
}

[[noreturn]] void refuse(const RgbdFrame& input, const std::string& reason) {
  throw InputError(input.stamp.empty() ? fmt::format("frame at {} s", input.t) : "frame " + input.stamp, 0,
                   reason);
}

}  // namespace

void check_input(const RgbdFrame& input, const std::optional<Masks>& prior, const CameraConfig& camera,
                 const std::optional<double>& last_t) {
  const auto check = [&](const cv::Mat& image, int type, const char* name) {
    if (image.dims <= 2 && image.cols == camera.width && image.rows == camera.height && image.type() == type)
      return;
    refuse(input, fmt::format("the {} is {}, not {} as the camera's images", name,
                              image.empty() ? "empty" : describe(image.cols, image.rows, image.type()),
                              describe(camera.width, camera.height, type)));
  };
  check(input.gray, CV_8UC1, "grey image");
  check(input.depth, CV_32FC1, "depth image");
  if (input.features && !input.features->pyramid.levels.empty())
    check(input.features->pyramid.levels.front(), CV_8UC1, "image that the features are of");
  if (prior) {
    if (!prior->dynamic.empty()) check(prior->dynamic, CV_8UC1, "a-priori mask");
    if (!prior->labels.empty()) check(prior->labels, CV_8UC1, "label image");
    if (!prior->instances.empty()) check(prior->instances, CV_16UC1, "instance image");
    if (prior->earlier) {
      check(prior->earlier->depth, CV_32FC1, "earlier frame's depth image");
      check(prior->earlier->labels, CV_8UC1, "earlier frame's label image");
    }
  }
  check_times(input, last_t);
}

void check_times(const RgbdFrame& input, const std::optional<double>& last_t) {
  if (!std::isfinite(input.t) || !std::isfinite(input.depth_delay))
    refuse(input, fmt::format("the time {} s or the delay {} s of its depth is not a number", input.t,
                              input.depth_delay));
  constexpr double kFarthest = 1e18;  // seconds: no clock counts so many of anything
  if (std::abs(input.t) > kFarthest || std::abs(input.depth_delay) > kFarthest)
    refuse(input, fmt::format("the time {} s or the delay {} s of its depth is no time in seconds", input.t,
                              input.depth_delay));
  if (last_t && input.t <= *last_t)
    refuse(input,
           fmt::format("its time {} s does not come after {} s, the frame's before", input.t, *last_t));
}

}  // namespace dynslam::runtime
