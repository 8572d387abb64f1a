// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <span>
#include <string>

namespace dynslam::runtime {

struct JpegCheck {
  cv::Size size;
  std::string fault;  ///< empty: none
};

/// Decodes a JPEG's data as far as its coefficients: what a decoder only warns of, and replaces by grey, is a
/// fault here. A few surplus bytes before a marker are not, some cameras write them.
/// @param largest  longest side that is decoded [px]; with more only the size is told
[[nodiscard]] JpegCheck check_jpeg(std::span<const std::uint8_t> bytes, int largest);

}  // namespace dynslam::runtime
