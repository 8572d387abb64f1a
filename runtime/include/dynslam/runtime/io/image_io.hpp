// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <opencv2/core.hpp>

namespace dynslam::runtime {

/// Decodes a PNG or JPEG file, complete or not at all: OpenCV returns half a picture for a truncated
/// file without a word, so the end marker of the format is checked first.
/// @param flags  cv::ImreadModes
/// @throws InputError naming the file
[[nodiscard]] cv::Mat read_image(const std::filesystem::path& path, int flags);

/// Writes an image by the extension of `path` (PNG: fast compression). @throws InputError
void write_image(const std::filesystem::path& path, const cv::Mat& image);

}  // namespace dynslam::runtime
