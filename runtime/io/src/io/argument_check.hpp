// SPDX-License-Identifier: BSD-3-Clause
// Arguments of public functions: what would be undefined behaviour further in is one readable exception here.
#pragma once

#include <opencv2/core.hpp>

#include "dynslam/geometry/se3.hpp"
#include "dynslam/runtime/io/camera.hpp"

namespace dynslam::runtime {

/// @param what  function and argument, for the message
/// @param size  0 x 0: any, but not empty
/// @throws UsageError with what the image is and what was expected
void check_image(const cv::Mat& image, cv::Size size, int type, const char* what);
/// Like check_image(), but an empty image is well.
void check_optional_image(const cv::Mat& image, cv::Size size, int type, const char* what);
/// @throws UsageError where a number is not finite
void check_pose(const SE3<double>& T, const char* what);
/// @throws UsageError where no image could come from it. @return the camera
const CameraConfig& checked(const CameraConfig& camera);
/// @throws UsageError with the message where `condition` does not hold
void check_argument(bool condition, const char* message);

}  // namespace dynslam::runtime
