// SPDX-License-Identifier: BSD-3-Clause
// A mask file as it is stored, whatever its values mean.
#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <string_view>
#include <vector>

#include "dynslam/runtime/io/image_io.hpp"

namespace dynslam::runtime {

/// What the pixels of a mask file are stored as.
enum class MaskStorage {
  grey,     ///< CV_8UC1; also colours that are all grey, and 0 or 255 of a JPEG
  indexed,  ///< CV_8UC1, indices of a palette
  deep,     ///< CV_16UC1
  colour,   ///< CV_8UC1: 255 where a pixel is not black
  alpha     ///< CV_8UC1, the alpha channel of a picture
};
/// In the user's words, "8-bit grey" and the like.
[[nodiscard]] std::string_view to_string(MaskStorage storage);

struct MaskImage {
  MaskStorage storage = MaskStorage::grey;
  cv::Mat values;
  bool voc = false;  ///< indexed: the palette is Pascal VOC's
  std::vector<int>
      colours{};  ///< colour: 0xRRGGBB that occur beside black, in order, as many as are told apart
};

/// @param by_index  the values of a palette are wanted as they are, even where its colours are grey
/// @throws InputError where the file cannot be decoded
[[nodiscard]] MaskImage read_mask_image(const EncodedImage& file, bool by_index);

}  // namespace dynslam::runtime
