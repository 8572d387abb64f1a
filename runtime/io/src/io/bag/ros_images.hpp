// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <opencv2/core.hpp>
#include <string>

#include "io/bag/ros_messages.hpp"

namespace dynslam::runtime::bag {

/// What an image is by its encoding (of compressed ones: their format).
enum class ImageKind {
  colour,         ///< three or four channels of 8 bit
  grey,           ///< one of 8 bit: of a grey camera, or infrared
  depth,          ///< 16UC1 in millimetres, 32FC1 in metres
  sixteen_bit,    ///< mono16: depth of old drivers, or infrared
  not_understood  ///< Bayer, YUV, ...
};
[[nodiscard]] ImageKind kind_of(const std::string& encoding, bool compressed);

/// Width and height, by the head of the data where they are compressed. @throws InputError (name)
[[nodiscard]] cv::Size size_of(const ImageMessage& image, bool compressed, const std::string& name);

/// @return CV_8UC3 (BGR) @throws InputError (name)
[[nodiscard]] cv::Mat decode_colour(const ImageMessage& image, bool compressed, const std::string& name);

/// @return CV_16UC1 in the camera's units, or CV_32FC1 in metres, NaN = none @throws InputError (name)
[[nodiscard]] cv::Mat decode_depth(const ImageMessage& image, bool compressed, const std::string& name);

}  // namespace dynslam::runtime::bag
