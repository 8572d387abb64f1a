// SPDX-License-Identifier: BSD-3-Clause
#include "io/frame_of_images.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <opencv2/core/check.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

#include "dynslam/image/depth.hpp"
#include "dynslam/interop/opencv.hpp"
#include "dynslam/runtime/error.hpp"

namespace dynslam::runtime {
namespace {

void check_size(const cv::Mat& image, const char* name, const std::string& frame,
                const CameraConfig& camera) {
  if (image.dims <= 2 && image.cols == camera.width && image.rows == camera.height) return;
  throw InputError(frame, 0,
                   image.empty() ? fmt::format("the {} is empty", name)
                                 : fmt::format("the {} is {}x{}, the camera's images are {}x{}", name,
                                               image.cols, image.rows, camera.width, camera.height));
}

}  // namespace

cv::Mat depth_in_metres(const cv::Mat& depth, const CameraConfig& camera) {
  cv::Mat metres(depth.size(), CV_32FC1);
  depth_to_metres<float>(interop::view<const std::uint16_t>(depth),
                         static_cast<float>(camera.depth_units_per_metre), interop::view<float>(metres));
  if (camera.invalid_depth > 0)  // 0 is none in every format
    metres.setTo(cv::Scalar::all(std::numeric_limits<double>::quiet_NaN()), depth == camera.invalid_depth);
  return metres;
}

cv::Mat checked_metres(cv::Mat metres) {
  for (int v = 0; v < metres.rows; ++v) {
    for (int u = 0; u < metres.cols; ++u) {
      float& z = metres.at<float>(v, u);
      if (!(z > 0) || !std::isfinite(z)) z = std::numeric_limits<float>::quiet_NaN();
    }
  }
  return metres;
}

void check_images(const cv::Mat& image, const cv::Mat& depth, double t, const CameraConfig& camera) {
  const std::string name = fmt::format("frame at {} s", t);
  check_size(image, "image", name, camera);
  check_size(depth, "depth image", name, camera);
  if (image.type() != CV_8UC3 && image.type() != CV_8UC4 && image.type() != CV_8UC1)
    throw InputError(
        name, 0,
        fmt::format("the image is {}, not CV_8UC3, CV_8UC4 or CV_8UC1", cv::typeToString(image.type())));
  if (depth.type() != CV_16UC1 && depth.type() != CV_32FC1)
    throw InputError(
        name, 0,
        fmt::format("the depth image is {}, not CV_16UC1 (units of the camera) or CV_32FC1 (metres)",
                    cv::typeToString(depth.type())));
}

RgbdFrame frame_of_images(const cv::Mat& image, const cv::Mat& depth, const TimeStamp& time,
                          const CameraConfig& camera) {
  check_images(image, depth, time.t, camera);
  RgbdFrame frame;
  frame.t = time.t;
  frame.ns = time.ns;
  if (time.ns != 0) {
    frame.stamp = nanosecond_text(time.ns);
  } else if (std::isfinite(time.t)) {
    frame.stamp = fmt::format("{:.6f}", time.t);
  }
  if (image.type() == CV_8UC3) {
    frame.bgr = image.clone();
  } else {
    cv::cvtColor(image, frame.bgr, image.type() == CV_8UC4 ? cv::COLOR_BGRA2BGR : cv::COLOR_GRAY2BGR);
  }
  if (image.type() == CV_8UC1) {
    frame.gray = image.clone();
  } else {
    cv::cvtColor(frame.bgr, frame.gray, cv::COLOR_BGR2GRAY);
  }
  frame.depth = depth.type() == CV_16UC1 ? depth_in_metres(depth, camera) : depth.clone();
  return frame;
}

}  // namespace dynslam::runtime
