// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace dynslam::runtime {

/// The images of a sequence that are no files of their own, by their numbers there: those of a bag. Images
/// are decoded when they are asked for; any thread may ask.
class ImageSource {
 public:
  enum class Kind { colour, depth };

  ImageSource() = default;
  ImageSource(const ImageSource&) = delete;
  ImageSource& operator=(const ImageSource&) = delete;
  virtual ~ImageSource() = default;
  /// Colour as CV_8UC3 (BGR); depth as CV_16UC1 in the camera's units, or CV_32FC1 in metres, NaN = none.
  /// @throws InputError naming the image
  [[nodiscard]] virtual cv::Mat read(Kind kind, std::size_t number) const = 0;
  /// By the image's head, without decoding it. @throws InputError naming the image
  [[nodiscard]] virtual cv::Size size(Kind kind, std::size_t number) const = 0;
  /// What tells one image from another: its bytes as stored, without its time. @throws InputError
  [[nodiscard]] virtual std::vector<std::uint8_t> content(Kind kind, std::size_t number) const = 0;
};

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
