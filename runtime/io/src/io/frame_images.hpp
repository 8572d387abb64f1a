// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <opencv2/core.hpp>

#include "dynslam/runtime/io/sequence.hpp"

namespace dynslam::runtime {

/// An image of a frame, wherever it lies: colour as CV_8UC3, depth as it is stored.
/// @param expected  size that it must have; empty: any. What has another one is not decoded.
/// @throws InputError naming it
[[nodiscard]] cv::Mat read_image(const FrameRecord& record, ImageSource::Kind kind, cv::Size expected = {});

/// Its size, without decoding it. @throws InputError naming it
[[nodiscard]] cv::Size stored_size(const FrameRecord& record, ImageSource::Kind kind);

}  // namespace dynslam::runtime
