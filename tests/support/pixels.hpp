// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "dynslam/image/image.hpp"

namespace dynslam::test {

/// The pixels of an image, row by row, to compare.
[[nodiscard]] inline std::vector<std::uint8_t> pixels(const Image<std::uint8_t>& image) {
  return {image.data(), image.data() + image.width() * image.height()};
}

}  // namespace dynslam::test
