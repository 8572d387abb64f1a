// SPDX-License-Identifier: BSD-3-Clause
#include "io/bag/ros_images.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <string_view>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "io/frame_of_images.hpp"

namespace dynslam::runtime::bag {
namespace {

/// sensor_msgs/image_encodings.h: an encoding, OpenCV's type, and how it becomes BGR (-1: it is, or depth).
struct Encoding {
  std::string_view name;
  ImageKind kind;
  int type, to_bgr;
};
constexpr std::array<Encoding, 12> kEncodings{{
    {"bgr8", ImageKind::colour, CV_8UC3, -1},
    {"rgb8", ImageKind::colour, CV_8UC3, cv::COLOR_RGB2BGR},
    {"bgra8", ImageKind::colour, CV_8UC4, cv::COLOR_BGRA2BGR},
    {"rgba8", ImageKind::colour, CV_8UC4, cv::COLOR_RGBA2BGR},
    {"8UC3", ImageKind::colour, CV_8UC3, -1},
    {"8UC4", ImageKind::colour, CV_8UC4, cv::COLOR_BGRA2BGR},
    {"mono8", ImageKind::grey, CV_8UC1, cv::COLOR_GRAY2BGR},
    {"8UC1", ImageKind::grey, CV_8UC1, cv::COLOR_GRAY2BGR},
    {"16UC1", ImageKind::depth, CV_16UC1, -1},
    {"32FC1", ImageKind::depth, CV_32FC1, -1},
    {"mono16", ImageKind::sixteen_bit, CV_16UC1, -1},
    {"16SC1", ImageKind::not_understood, CV_16SC1, -1},
}};

const Encoding* find_encoding(std::string_view name) {
  const auto found =
      std::find_if(kEncodings.begin(), kEncodings.end(), [&](const auto& e) { return e.name == name; });
  return found == kEncodings.end() ? nullptr : &*found;
}

/// The parts of a compressed image's format, "16UC1; compressedDepth png": encoding before it was compressed
/// (empty: not said, as of the first drivers, "jpeg") and how.
struct Compression {
  std::string_view encoding, how;
};
Compression compression_of(std::string_view format) {
  const auto semicolon = format.find(';');
  if (semicolon == std::string_view::npos) return {{}, format};
  std::string_view how = format.substr(semicolon + 1);
  how.remove_prefix(std::min(how.find_first_not_of(' '), how.size()));
  return {format.substr(0, semicolon), how};
}

/// The image as it lies in the message, in the byte order of this machine.
cv::Mat raw_image(const ImageMessage& image, const std::string& name) {
  const auto refuse = [&](const std::string& reason) { throw InputError(name, 0, reason); };
  const Encoding* encoding = find_encoding(image.encoding);
  if (encoding == nullptr) refuse(fmt::format("the encoding '{}' is not read", image.encoding));
  const auto pixel = static_cast<std::uint64_t>(CV_ELEM_SIZE(encoding->type));
  constexpr std::uint32_t kLongest = kLongestSide;
  if (image.width == 0 || image.height == 0 || image.width > kLongest || image.height > kLongest)
    refuse(fmt::format("is {}x{} pixels; at most {} a side are read", image.width, image.height, kLongest));
  if (image.step < pixel * image.width)
    refuse(fmt::format("a row of {} bytes holds no {} pixels of {} bytes", image.step, image.width, pixel));
  if (image.data.size() < std::uint64_t(image.step) * (image.height - 1) + pixel * image.width)
    refuse(fmt::format("{} rows of {} bytes were expected, the image has {} bytes", image.height, image.step,
                       image.data.size()));
  cv::Mat result(static_cast<int>(image.height), static_cast<int>(image.width), encoding->type);
  const std::size_t row_bytes = static_cast<std::size_t>(pixel) * image.width;
  const auto channel = static_cast<std::size_t>(result.elemSize1());
  const bool swap = channel > 1 && image.big_endian != (std::endian::native == std::endian::big);
  for (int v = 0; v < result.rows; ++v) {
    std::uint8_t* row = result.ptr<std::uint8_t>(v);
    std::memcpy(row, image.data.data() + std::size_t(image.step) * static_cast<std::size_t>(v), row_bytes);
    for (std::size_t k = 0; swap && k < row_bytes; k += channel) std::reverse(row + k, row + k + channel);
  }
  return result;
}

/// The header before compressed depth: how it was compressed, and the two numbers of inverse depth.
struct DepthHeader {
  float a = 0, b = 0;
};
constexpr std::size_t kDepthHeader = 12;

DepthHeader depth_header(Bytes data, const std::string& name) {
  if (data.size() < kDepthHeader) throw InputError(name, 0, "is too short for compressed depth");
  const auto at = [&](std::size_t offset) {
    std::uint32_t bits = 0;
    for (std::size_t k = 0; k < 4; ++k) bits |= static_cast<std::uint32_t>(data[offset + k]) << (8 * k);
    return std::bit_cast<float>(bits);
  };
  return {at(4), at(8)};
}

EncodedImage encoded(Bytes data, const std::string& name) {
  return {name, std::string(reinterpret_cast<const char*>(data.data()), data.size())};
}

bool is_compressed_depth(const Compression& c) {
  return c.how.starts_with("compressedDepth");
}

/// Without its header; it is a PNG also where the format does not say so.
EncodedImage compressed_depth(const ImageMessage& image, const std::string& name) {
  const Compression c = compression_of(image.encoding);
  if (!is_compressed_depth(c)) return encoded(image.data, name);
  if (c.how.find("rvl") != std::string_view::npos)
    throw InputError(name, 0, fmt::format("compressed as '{}', which is not read; PNG is", image.encoding));
  (void)depth_header(image.data, name);
  return encoded(image.data.subspan(kDepthHeader), name);
}

/// compressed_depth_image_transport: depth = a / (value - b), 0 = none.
cv::Mat from_inverse(const cv::Mat& values, const DepthHeader& header) {
  cv::Mat metres(values.size(), CV_32FC1);
  for (int v = 0; v < values.rows; ++v) {
    for (int u = 0; u < values.cols; ++u) {
      const std::uint16_t value = values.at<std::uint16_t>(v, u);
      metres.at<float>(v, u) = value > 0 ? header.a / (static_cast<float>(value) - header.b)
                                         : std::numeric_limits<float>::quiet_NaN();
    }
  }
  return metres;
}

}  // namespace

ImageKind kind_of(const std::string& encoding, bool compressed) {
  if (!compressed) {
    const Encoding* found = find_encoding(encoding);
    return found != nullptr ? found->kind : ImageKind::not_understood;
  }
  const Compression c = compression_of(encoding);
  if (is_compressed_depth(c)) return ImageKind::depth;
  const Encoding* before = find_encoding(c.encoding);
  if (before != nullptr && before->kind != ImageKind::not_understood) return before->kind;
  // Colour of Bayer patterns, too, is compressed as colour.
  const bool known =
      c.how.find("jp") != std::string_view::npos || c.how.find("png") != std::string_view::npos;
  return known ? ImageKind::colour : ImageKind::not_understood;
}

cv::Size size_of(const ImageMessage& image, bool compressed, const std::string& name) {
  if (compressed) return compressed_depth(image, name).size();
  constexpr std::uint32_t kMost = std::numeric_limits<int>::max();
  return {static_cast<int>(std::min(image.width, kMost)), static_cast<int>(std::min(image.height, kMost))};
}

cv::Mat decode_colour(const ImageMessage& image, bool compressed, const std::string& name) {
  const ImageKind kind = kind_of(image.encoding, compressed);
  if (kind != ImageKind::colour && kind != ImageKind::grey)
    throw InputError(name, 0,
                     fmt::format("'{}' is no encoding of a colour image that is read", image.encoding));
  if (compressed) return encoded(image.data, name).decode(cv::IMREAD_COLOR);
  const cv::Mat raw = raw_image(image, name);
  const int to_bgr = find_encoding(image.encoding)->to_bgr;
  if (to_bgr < 0) return raw;
  cv::Mat bgr;
  cv::cvtColor(raw, bgr, to_bgr);
  return bgr;
}

cv::Mat decode_depth(const ImageMessage& image, bool compressed, const std::string& name) {
  const ImageKind kind = kind_of(image.encoding, compressed);
  if (kind != ImageKind::depth && kind != ImageKind::sixteen_bit)
    throw InputError(name, 0, fmt::format("'{}' is no encoding of depth that is read", image.encoding));
  if (!compressed) {
    cv::Mat raw = raw_image(image, name);
    return raw.type() == CV_32FC1 ? checked_metres(std::move(raw)) : raw;
  }
  cv::Mat values = compressed_depth(image, name).decode(cv::IMREAD_UNCHANGED);
  if (values.type() != CV_16UC1) throw InputError(name, 0, "is not a 16-bit image of one channel");
  const Compression c = compression_of(image.encoding);
  if (c.encoding != "32FC1") return values;
  if (!is_compressed_depth(c)) throw InputError(name, 0, "32FC1 in a PNG of 16 bit means nothing");
  return checked_metres(from_inverse(values, depth_header(image.data, name)));
}

}  // namespace dynslam::runtime::bag
