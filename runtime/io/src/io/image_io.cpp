// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/io/image_io.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <span>
#include <system_error>
#include <utility>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/atomic_file.hpp"
#include "dynslam/runtime/io/read_file.hpp"
#include "io/byte_marker.hpp"
#include "io/depth_files.hpp"
#include "io/jpeg_check.hpp"
#include "io/png_decoder.hpp"

namespace dynslam::runtime {
namespace {

constexpr std::array<std::uint8_t, 8> kPngStart{0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'};
constexpr std::array<std::uint8_t, 8> kPngEnd{'I', 'E', 'N', 'D', 0xAE, 0x42, 0x60, 0x82};
constexpr std::array<std::uint8_t, 2> kJpegStart{0xFF, 0xD8};
constexpr std::array<std::uint8_t, 2> kJpegEnd{0xFF, 0xD9};

using Bytes = std::span<const std::uint8_t>;

/// Cameras and tools may append bytes behind the image, so the marker may stand a little before the end.
template <class Marker>
bool ends_with(Bytes bytes, const Marker& marker) {
  constexpr std::size_t kSlack = 512;
  const Bytes tail = bytes.last(std::min(kSlack, bytes.size()));
  return std::search(tail.begin(), tail.end(), marker.begin(), marker.end()) != tail.end();
}

Bytes bytes_of(const std::string& content) {
  return {reinterpret_cast<const std::uint8_t*>(content.data()), content.size()};
}

/// Whether OpenCV would hand out what the file holds, without converting it.
bool wanted_as_stored(const PngFile& png, int flags) {
  if (flags == cv::IMREAD_UNCHANGED) return true;
  return png.bits == 8 && flags == (png.channels == 3 ? cv::IMREAD_COLOR : cv::IMREAD_GRAYSCALE);
}

/// Renderers write depth to each colour of an OpenEXR file.
cv::Mat grey_of(const cv::Mat& image, const std::string& name) {
  std::vector<cv::Mat> planes;
  cv::split(image, planes);
  for (std::size_t k = 1; k < 3; ++k) {
    if (cv::norm(planes[0], planes[k], cv::NORM_INF) != 0)
      throw InputError(name, 0,
                       fmt::format("has {} channels that differ, which no depth has", image.channels()));
  }
  return planes[0];
}

}  // namespace

EncodedImage::EncodedImage(const std::filesystem::path& path) : EncodedImage(path, read_file(path)) {}

EncodedImage::EncodedImage(std::filesystem::path name, std::string content)
    : path_(std::move(name)), content_(std::move(content)) {
  const auto refuse = [&](const std::string& reason) { throw InputError(path_.string(), 0, reason); };
  const Bytes bytes = bytes_of(content_);
  const bool png = starts_with(bytes, kPngStart), jpeg = starts_with(bytes, kJpegStart);
  if (bytes.empty()) refuse("is empty");
  const auto depth = depth_file_kind(bytes);
  if (!png && !jpeg && !depth) refuse("is neither PNG nor JPEG, nor depth as TIFF, OpenEXR or .npy");
  if ((png && !ends_with(bytes, kPngEnd)) || (jpeg && !ends_with(bytes, kJpegEnd))) refuse("is truncated");
  std::string fault;
  if (png) {
    png_ = std::make_shared<const PngFile>(open_png(bytes, kLongestSide));
    size_ = png_->size;
    fault = png_->fault;
  } else if (depth) {
    depth_ = std::make_shared<const DepthFile>(open_depth_file(*depth, bytes));
    size_ = depth_->size;
    if (!depth_->fault.empty()) refuse(depth_->fault);
  } else {
    const JpegCheck check = check_jpeg(bytes, kLongestSide);
    size_ = check.size;
    fault = check.fault;
  }
  if (std::max(size_.width, size_.height) > kLongestSide)
    refuse(
        fmt::format("is {}x{} pixels; at most {} a side are read", size_.width, size_.height, kLongestSide));
  if (!fault.empty()) refuse("is damaged: " + fault);
}

std::vector<std::array<std::uint8_t, 3>> EncodedImage::palette() const {
  if (!png_) return {};
  return png_->palette;
}

cv::Mat EncodedImage::decode(int flags) const {
  const Bytes bytes = bytes_of(content_);
  if (flags == cv::IMREAD_COLOR && png_ && png_->bits == 16 && png_->channels == 1)
    throw InputError(path_.string(), 0, "has one channel of 16 bits, as depth has: colour has 8 bits");
  cv::Mat image;
  if (depth_ && depth_->kind == DepthFileKind::npy) return decode_npy(bytes, *depth_);
  if (png_ && png_->plain && wanted_as_stored(*png_, flags)) {
    std::string fault;
    image = decode_plain_png(bytes, *png_, fault);
    if (!fault.empty()) throw InputError(path_.string(), 0, "is damaged: " + fault);
    if (!image.empty()) return image;
  }
  try {
    // Depth and masks know nothing of an EXIF orientation, by which OpenCV would turn the colours alone.
    const cv::Mat data(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<std::uint8_t*>(bytes.data()));
    image = cv::imdecode(data, flags | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception&) {
    image.release();
  }
  if (image.empty()) throw InputError(path_.string(), 0, "cannot be decoded");
  if (depth_ && depth_->kind == DepthFileKind::exr && image.channels() > 1)
    image = grey_of(image, path_.string());
  return image;
}

cv::Mat read_image(const std::filesystem::path& path, int flags) {
  return EncodedImage(path).decode(flags);
}

void write_image(const std::filesystem::path& path, const cv::Mat& image) {
  std::vector<std::uint8_t> encoded;
  bool done = false;
  std::vector<int> options;
  if (path.extension() == ".png") {
    // Trying all filters pays for masks alone. Without a level OpenCV takes the differences along each row,
    // in two thirds of the time for colours and depths, which grow by 3 % and shrink by 10 %.
    options = image.type() == CV_8UC1
                  ? std::vector<int>{cv::IMWRITE_PNG_COMPRESSION, 1}
                  : std::vector<int>{cv::IMWRITE_PNG_STRATEGY, cv::IMWRITE_PNG_STRATEGY_DEFAULT};
  }
  try {
    done = cv::imencode(path.extension().string(), image, encoded, options);
  } catch (const cv::Exception&) {
    done = false;
  }
  if (!done) throw InputError(path.string(), 0, "cannot be written: no such kind of image");
  AtomicFile file(path);
  file.stream().write(reinterpret_cast<const char*>(encoded.data()),
                      static_cast<std::streamsize>(encoded.size()));
  file.commit(OnDisk::eventually);  // thousands of masks: the system may take its time
}

std::size_t count_pngs(const std::filesystem::path& folder) {
  std::size_t count = 0;
  std::error_code error;
  for (std::filesystem::directory_iterator it(folder, error), end; !error && it != end; it.increment(error))
    count += it->path().extension() == ".png" ? 1 : 0;
  return count;
}

}  // namespace dynslam::runtime
