// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/io/mask_reader.hpp"

#include <fmt/format.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/image_io.hpp"

namespace dynslam::runtime {

MaskSource::MaskSource(std::filesystem::path folder, MaskOptions options)
    : folder_(std::move(folder)), options_(std::move(options)) {
  if (!std::filesystem::is_directory(folder_))
    throw InputError(folder_.string(), 0, "is not a folder of masks");
  if (std::filesystem::is_directory(folder_ / "label")) folder_ /= "label";
}

std::optional<Masks> MaskSource::read(const std::string& stamp, int width, int height) {
  const std::filesystem::path path = folder_ / (stamp + ".png");
  if (!std::filesystem::exists(path)) {
    ++missing_;
    return std::nullopt;
  }
  const EncodedImage file(path);
  if (const cv::Size size = file.size(); size != cv::Size(width, height)) {
    throw InputError(path.string(), 0,
                     fmt::format("is {}x{}, the images are {}x{}", size.width, size.height, width, height));
  }
  const cv::Mat image = file.decode(cv::IMREAD_UNCHANGED);
  Masks masks;
  if (image.type() == CV_16UC1) {
    masks.instances = image;
    masks.dynamic = image != 0;
  } else if (image.type() == CV_8UC1) {
    const cv::Mat between = (image != 0) & (image != 255);
    if (cv::countNonZero(between) == 0) {
      masks.dynamic = image;
      cv::connectedComponents(image, masks.instances, 8, CV_16U);
    } else {
      masks.labels = image;
      masks.dynamic = cv::Mat::zeros(image.size(), CV_8UC1);
      for (const std::uint8_t label : options_.dynamic_labels) masks.dynamic |= image == label;
    }
  } else {
    throw InputError(path.string(), 0, "is neither an 8-bit mask or label image nor a 16-bit instance image");
  }
  return masks;
}

}  // namespace dynslam::runtime
