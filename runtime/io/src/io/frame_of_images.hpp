// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <opencv2/core.hpp>

#include "dynslam/runtime/frame.hpp"
#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/io/time_stamp.hpp"

namespace dynslam::runtime {

/// What frame_of_images() would refuse. @throws InputError with the type or size that an image has and what
/// was expected
void check_images(const cv::Mat& image, const cv::Mat& depth, double t, const CameraConfig& camera);

/// A frame whose images share nothing with those given.
/// @param image  CV_8UC3 (BGR), CV_8UC4 (BGRA) or CV_8UC1
/// @param depth  CV_16UC1 in the camera's units, or CV_32FC1 in metres
/// @throws InputError with the type or size that an image has and what was expected
[[nodiscard]] RgbdFrame frame_of_images(const cv::Mat& image, const cv::Mat& depth, const TimeStamp& time,
                                        const CameraConfig& camera);

/// 16-bit depth in the camera's units as metres, NaN where there is none.
[[nodiscard]] cv::Mat depth_in_metres(const cv::Mat& depth, const CameraConfig& camera);
/// Depth as CV_32FC1, in which what is no distance (0, negative, infinite) becomes NaN.
[[nodiscard]] cv::Mat checked_metres(cv::Mat metres);

}  // namespace dynslam::runtime
