// SPDX-License-Identifier: BSD-3-Clause
#include "io/argument_check.hpp"

#include <fmt/format.h>

#include <cmath>
#include <opencv2/core/check.hpp>
#include <string>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/image_io.hpp"

namespace dynslam::runtime {

void check_image(const cv::Mat& image, cv::Size size, int type, const char* what) {
  const bool any = size.empty();
  if (image.dims == 2 && !image.empty() && image.type() == type && (any || image.size() == size)) return;
  const std::string expected = any ? "any size of" : fmt::format("{}x{}", size.width, size.height);
  const std::string found =
      image.empty() ? std::string("empty")
                    : fmt::format("{}x{} {}", image.cols, image.rows, cv::typeToString(image.type()));
  throw UsageError(fmt::format("{} is {}; expected {} {}", what, found, expected, cv::typeToString(type)));
}

void check_optional_image(const cv::Mat& image, cv::Size size, int type, const char* what) {
  if (!image.empty()) check_image(image, size, type, what);
}

void check_pose(const SE3<double>& T, const char* what) {
  if (!T.translation().allFinite() || !T.so3().quaternion().coeffs().allFinite())
    throw UsageError(fmt::format("{} has a number that is not finite; expected a rigid motion", what));
}

const CameraConfig& checked(const CameraConfig& camera) {
  const auto& pinhole = camera.model.pinhole();
  const auto side = [](int pixels) { return pixels > 0 && pixels <= kLongestSide; };
  const auto positive = [](double x) { return x > 0 && std::isfinite(x); };
  if (!side(camera.width) || !side(camera.height) || !positive(pinhole.fx()) || !positive(pinhole.fy()) ||
      !std::isfinite(pinhole.cx()) || !std::isfinite(pinhole.cy()) || !positive(camera.depth_units_per_metre))
    throw UsageError(fmt::format(
        "camera {}: {}x{} pixels, fx {} fy {} cx {} cy {}, {} depth units per metre; expected sides from 1 "
        "to {}, finite numbers, fx, fy and units above 0",
        camera.name, camera.width, camera.height, pinhole.fx(), pinhole.fy(), pinhole.cx(), pinhole.cy(),
        camera.depth_units_per_metre, kLongestSide));
  return camera;
}

void check_argument(bool condition, const char* message) {
  if (!condition) throw UsageError(message);
}

}  // namespace dynslam::runtime
