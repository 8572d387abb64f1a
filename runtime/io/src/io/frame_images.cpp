// SPDX-License-Identifier: BSD-3-Clause
#include "io/frame_images.hpp"

#include <fmt/format.h>

#include <opencv2/imgcodecs.hpp>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "io/depth_files.hpp"
#include "io/frame_of_images.hpp"

namespace dynslam::runtime {
namespace {

using Kind = ImageSource::Kind;

const ImagePath& path_of(const FrameRecord& record, Kind kind) {
  return kind == Kind::colour ? record.rgb : record.depth;
}

std::size_t number_of(const FrameRecord& record, Kind kind) {
  return kind == Kind::colour ? record.colour_number : record.depth_number;
}

void check_size(const FrameRecord& record, Kind kind, cv::Size size, cv::Size expected) {
  if (expected.empty() || size == expected) return;
  throw InputError(path_of(record, kind).string(), 0,
                   fmt::format("is {}x{}, the camera's images are {}x{}", size.width, size.height,
                               expected.width, expected.height));
}

}  // namespace

cv::Mat read_image(const FrameRecord& record, Kind kind, cv::Size expected) {
  if (record.source) {
    cv::Mat image = record.source->read(kind, number_of(record, kind));
    check_size(record, kind, image.size(), expected);
    return image;
  }
  const EncodedImage image(path_of(record, kind));
  check_size(record, kind, image.size(), expected);
  if (kind == Kind::colour) return image.decode(cv::IMREAD_COLOR);
  cv::Mat depth = image.decode(cv::IMREAD_UNCHANGED);
  if (record.float_bytes) depth = floats_of_channels(depth, record.depth.string());
  return depth.type() == CV_32FC1 ? checked_metres(depth) : depth;
}

cv::Size stored_size(const FrameRecord& record, Kind kind) {
  if (record.source) return record.source->size(kind, number_of(record, kind));
  return EncodedImage(std::filesystem::path(path_of(record, kind))).size();
}

}  // namespace dynslam::runtime
