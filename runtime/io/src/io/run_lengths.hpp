// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <span>
#include <vector>

namespace dynslam::runtime {

/// An image of few values as runs of equal ones, row after row without regard to the rows' ends: of each run
/// length * 8 + value as a variable-length number (LEB128, seven bits a byte, the lowest first).
/// @param values  CV_8UC1, 0 to 7
[[nodiscard]] std::vector<std::uint8_t> encode_runs(const cv::Mat& values);

/// The image again; nullopt where the runs do not fill it exactly.
[[nodiscard]] std::optional<cv::Mat> decode_runs(std::span<const std::uint8_t> runs, cv::Size size);

}  // namespace dynslam::runtime
