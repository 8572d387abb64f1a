// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/io/image_io.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <opencv2/imgcodecs.hpp>
#include <vector>

#include "dynslam/runtime/error.hpp"

namespace dynslam::runtime {
namespace {

constexpr std::array<std::uint8_t, 8> kPngStart{0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'};
constexpr std::array<std::uint8_t, 8> kPngEnd{'I', 'E', 'N', 'D', 0xAE, 0x42, 0x60, 0x82};
constexpr std::array<std::uint8_t, 2> kJpegStart{0xFF, 0xD8};
constexpr std::array<std::uint8_t, 2> kJpegEnd{0xFF, 0xD9};

template <class Marker>
bool starts_with(const std::vector<std::uint8_t>& bytes, const Marker& marker) {
  return bytes.size() >= marker.size() && std::equal(marker.begin(), marker.end(), bytes.begin());
}

/// Cameras and tools may append bytes behind the image, so the marker may stand a little before the end.
template <class Marker>
bool ends_with(const std::vector<std::uint8_t>& bytes, const Marker& marker) {
  constexpr std::ptrdiff_t kSlack = 512;
  const auto from = bytes.end() - std::min<std::ptrdiff_t>(kSlack, std::ssize(bytes));
  return std::search(from, bytes.end(), marker.begin(), marker.end()) != bytes.end();
}

}  // namespace

cv::Mat read_image(const std::filesystem::path& path, int flags) {
  std::ifstream in(path, std::ios::binary);
  if (!in || std::filesystem::is_directory(path)) throw InputError(path.string(), 0, "cannot be opened");
  const std::vector<std::uint8_t> bytes{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  const bool png = starts_with(bytes, kPngStart), jpeg = starts_with(bytes, kJpegStart);
  if (bytes.empty()) throw InputError(path.string(), 0, "is empty");
  if (!png && !jpeg) throw InputError(path.string(), 0, "is neither PNG nor JPEG");
  if ((png && !ends_with(bytes, kPngEnd)) || (jpeg && !ends_with(bytes, kJpegEnd))) {
    throw InputError(path.string(), 0, "is truncated");
  }
  cv::Mat image;
  try {
    // Depth and masks know nothing of an EXIF orientation, by which OpenCV would turn the colours alone.
    image = cv::imdecode(bytes, flags | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception&) {
    image.release();
  }
  if (image.empty()) throw InputError(path.string(), 0, "cannot be decoded");
  return image;
}

void write_image(const std::filesystem::path& path, const cv::Mat& image) {
  bool written = false;
  try {
    written = path.extension() == ".png" ? cv::imwrite(path.string(), image, {cv::IMWRITE_PNG_COMPRESSION, 1})
                                         : cv::imwrite(path.string(), image);
  } catch (const cv::Exception&) {
    written = false;
  }
  if (!written) throw InputError(path.string(), 0, "cannot be written");
}

}  // namespace dynslam::runtime
