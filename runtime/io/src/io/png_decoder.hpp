// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <span>
#include <string>
#include <vector>

namespace dynslam::runtime {

/// A PNG file taken apart, every check sum of what carries the image compared (the PNG specification, 5.3
/// and 5.4).
struct PngFile {
  cv::Size size;
  int bits = 0;          ///< of a sample
  int channels = 0;      ///< samples of a pixel; 0: another kind than grey and colour
  bool indexed = false;  ///< pixels are indices of the palette
  bool plain = false;    ///< what decode_plain_png() reads
  struct Part {
    std::size_t at = 0, length = 0;  ///< in the file [bytes]
  };
  std::vector<Part> data;                            ///< the compressed rows
  std::vector<std::array<std::uint8_t, 3>> palette;  ///< red, green, blue of each index; empty: no palette
  std::string fault;                                 ///< what is wrong with it; empty: nothing
};

/// @param bytes  of the file
/// @param longest_side  an image with a longer one is not looked at further than its size [px]
[[nodiscard]] PngFile open_png(std::span<const std::uint8_t> bytes, int longest_side);

/// The pixels of a file that is `plain`: rows from top to bottom, grey values of 8 or 16 bits or colours of 3
/// x 8, nothing transparent. Same pixels as cv::imdecode's, CV_8UC1, CV_16UC1 or CV_8UC3 (blue, green, red),
/// in less than half its time.
/// @param bytes  those that `file` was opened from
/// @param fault  what is wrong with the data; where it stays empty and so does the image, libpng may know
/// better
[[nodiscard]] cv::Mat decode_plain_png(std::span<const std::uint8_t> bytes, const PngFile& file,
                                       std::string& fault);

}  // namespace dynslam::runtime
