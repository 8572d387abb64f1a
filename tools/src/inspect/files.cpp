// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>
#include <map>
#include <span>
#include <system_error>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/read_file.hpp"
#include "inspect/measure.hpp"
#include "io/depth_files.hpp"
#include "io/frame_images.hpp"

namespace dynslam::runtime::inspect {
namespace {

namespace fs = std::filesystem;

int big_endian(std::istream& in, int bytes) {
  int value = 0;
  for (int k = 0; k < bytes; ++k) value = value << 8 | (in.get() & 0xFF);
  return value;
}

/// Of the first frame header (SOF); the markers before it are passed over.
std::optional<cv::Size> jpeg_size(std::istream& in) {
  constexpr int kMarkers = 1000;
  for (int k = 0; k < kMarkers && in; ++k) {
    if (in.get() != 0xFF) return std::nullopt;
    int marker = in.get();
    while (marker == 0xFF) marker = in.get();
    const int length = big_endian(in, 2);
    const bool frame = marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
    if (frame) {
      in.get();  // precision
      const int height = big_endian(in, 2), width = big_endian(in, 2);
      if (!in) return std::nullopt;
      return cv::Size(width, height);
    }
    if (length < 2) return std::nullopt;
    in.ignore(length - 2);
  }
  return std::nullopt;
}

using Kind = ImageSource::Kind;

/// Of depth that is neither PNG nor JPEG.
std::optional<cv::Size> depth_size(const fs::path& path) {
  try {
    const std::string content = read_file(path);
    const std::span bytes(reinterpret_cast<const std::uint8_t*>(content.data()), content.size());
    const auto kind = depth_file_kind(bytes);
    if (!kind) return std::nullopt;
    const DepthFile file = open_depth_file(*kind, bytes);
    if (file.size.empty()) return std::nullopt;
    return file.size;
  } catch (const InputError&) {  // reported as missing
    return std::nullopt;
  }
}

/// Width and height by the head of an image file, however damaged the rest is.
std::optional<cv::Size> size_of_file(const fs::path& path) {
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return std::nullopt;
  std::ifstream in(path, std::ios::binary);
  const int first = in.get();
  const int second = in.get();
  if (first == 0xFF && second == 0xD8) return jpeg_size(in);
  if (first != 0x89 || second != 'P') return depth_size(path);
  in.ignore(14);  // signature, length and name of the first chunk
  const int width = big_endian(in, 4), height = big_endian(in, 4);
  if (!in) return std::nullopt;
  return cv::Size(width, height);
}

/// Whether two images have the same bytes.
bool same_bytes(const FrameRecord& x, const FrameRecord& y, Kind kind) {
  if (x.source && y.source) {
    const auto content = [&](const FrameRecord& f) {
      return f.source->content(kind, kind == Kind::colour ? f.colour_number : f.depth_number);
    };
    try {
      return content(x) == content(y);
    } catch (const InputError&) {  // reported as unreadable
      return false;
    }
  }
  const fs::path a = kind == Kind::colour ? x.rgb : x.depth, b = kind == Kind::colour ? y.rgb : y.depth;
  if (a == b) return true;
  std::error_code error;
  const auto size = fs::file_size(a, error);
  if (error || size != fs::file_size(b, error) || error) return false;
  try {
    return read_file(a) == read_file(b);
  } catch (const InputError&) {  // reported as missing
    return false;
  }
}

/// Images that cannot be read, and sizes that are not the one expected.
class SizeCheck {
 public:
  SizeCheck(Kind kind, std::optional<cv::Size> expected) : kind_(kind), expected_(expected) {}
  void add(const FrameRecord& frame) {
    const fs::path path = kind_ == Kind::colour ? frame.rgb : frame.depth;
    in_files_ = frame.source == nullptr;
    const auto size = image_size(frame, kind_);
    if (!size) {
      if (unreadable_++ == 0) first_unreadable_ = path;
      return;
    }
    if (!expected_) expected_ = size;
    if (*size != *expected_ && others_++ == 0) {
      first_other_ = path;
      other_ = *size;
    }
  }
  void report(std::size_t of, std::vector<std::string>& warnings) const {
    const char* what = kind_ == Kind::colour ? "colour" : "depth";
    if (unreadable_ > 0)
      warnings.push_back(fmt::format("{} of {} {} images {}, the first {}", unreadable_, of, what,
                                     in_files_ ? "are missing or no image files" : "cannot be read",
                                     first_unreadable_.string()));
    if (others_ > 0)
      warnings.push_back(fmt::format("{} of {} {} images are not {}x{} as {}, the first {} ({}x{})", others_,
                                     of, what, expected_->width, expected_->height, "the camera's",
                                     first_other_.string(), other_.width, other_.height));
  }

 private:
  Kind kind_;
  bool in_files_ = true;
  std::optional<cv::Size> expected_;
  std::size_t unreadable_ = 0, others_ = 0;
  fs::path first_unreadable_, first_other_;
  cv::Size other_;
};

}  // namespace

std::optional<cv::Size> image_size(const FrameRecord& frame, Kind kind) {
  if (!frame.source) return size_of_file(kind == Kind::colour ? frame.rgb : frame.depth);
  try {
    return stored_size(frame, kind);
  } catch (const InputError&) {
    return std::nullopt;
  }
}

std::vector<std::string> check_files(const Sequence& sequence, const CameraConfig* camera) {
  std::vector<std::string> warnings;
  std::optional<cv::Size> size;
  if (camera != nullptr) size = cv::Size(camera->width, camera->height);
  const cv::Size scaled = sequence.frames.front().colour_size;
  SizeCheck colour(Kind::colour, scaled.empty() ? size : std::optional(scaled)), depth(Kind::depth, size);
  std::size_t colour_again = 0, depth_again = 0;
  std::string first_again;
  const FrameRecord* before = nullptr;
  for (const FrameRecord& frame : sequence.frames) {
    colour.add(frame);
    depth.add(frame);
    const bool same_colour = before != nullptr && same_bytes(*before, frame, Kind::colour);
    const bool same_depth = before != nullptr && same_bytes(*before, frame, Kind::depth);
    if (first_again.empty() && (same_colour || same_depth)) first_again = frame.stamp;
    colour_again += same_colour ? 1 : 0;
    depth_again += same_depth ? 1 : 0;
    before = &frame;
  }
  colour.report(sequence.frames.size(), warnings);
  depth.report(sequence.frames.size(), warnings);
  if (colour_again + depth_again > 0)
    warnings.push_back(fmt::format("{} colour and {} depth images are the one before once more, first at {}",
                                   colour_again, depth_again, first_again));
  return warnings;
}

}  // namespace dynslam::runtime::inspect
