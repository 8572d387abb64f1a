// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <span>
#include <string>

namespace dynslam::runtime {

/// Kinds of files that hold depth besides PNG: arrays of numpy, TIFF and OpenEXR.
enum class DepthFileKind { npy, tiff, exr };

/// By the first bytes; nullopt: none of them.
[[nodiscard]] std::optional<DepthFileKind> depth_file_kind(std::span<const std::uint8_t> bytes);

/// What the head of a file says, before anything is decoded.
struct DepthFile {
  DepthFileKind kind{};
  cv::Size size;              ///< [px]
  std::string fault;          ///< what is wrong with it; empty: nothing
  int type = -1;              ///< of an array's values: CV_8UC1, CV_16UC1, CV_16FC1, CV_32FC1 or CV_64FC1
  bool by_columns = false;    ///< an array in Fortran's order
  std::size_t values_at = 0;  ///< where an array's values begin [bytes]
};

/// @param bytes  of a file of the kind
[[nodiscard]] DepthFile open_depth_file(DepthFileKind kind, std::span<const std::uint8_t> bytes);

/// An array's values: CV_8UC1, CV_16UC1 or CV_32FC1 (halves and doubles are converted).
/// @param bytes  those that `file` was opened from, without a fault
[[nodiscard]] cv::Mat decode_npy(std::span<const std::uint8_t> bytes, const DepthFile& file);

/// The floats whose bytes, least significant first, are the four channels of an image (TartanAir, version 2).
/// @param image  as OpenCV decodes it unchanged: blue is the first byte, alpha the last
/// @param name  of the file @throws InputError with it where the image has other channels
[[nodiscard]] cv::Mat floats_of_channels(const cv::Mat& image, const std::string& name);

}  // namespace dynslam::runtime
