// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace dynslam::runtime {

/// Longest side of an image [px], as of a camera's. A file of a few kilobytes may promise more than any
/// memory.
inline constexpr int kLongestSide = 8192;

struct PngFile;    // io/png_decoder.hpp
struct DepthFile;  // io/depth_files.hpp

/// A PNG or JPEG file, or depth as TIFF, OpenEXR or numpy's .npy, read and complete: OpenCV returns half a
/// picture for a truncated or damaged file without a word, so the end marker of the format is checked first,
/// a PNG's check sums, and a JPEG's whole data.
class EncodedImage {
 public:
  /// @throws InputError naming the file
  explicit EncodedImage(const std::filesystem::path& path);
  /// What such a file would hold. @throws InputError with this name
  EncodedImage(std::filesystem::path name, std::string content);
  [[nodiscard]] cv::Size size() const { return size_; }
  /// Red, green and blue of each index of a PNG with a palette, which decode() replaces by colours; empty:
  /// it has none.
  [[nodiscard]] std::vector<std::array<std::uint8_t, 3>> palette() const;
  [[nodiscard]] bool is_jpeg() const { return !png_ && !depth_; }
  /// @param flags  cv::ImreadModes; an array's values are what they are @throws InputError naming the file
  [[nodiscard]] cv::Mat decode(int flags) const;

 private:
  std::filesystem::path path_;
  std::string content_;
  cv::Size size_;
  std::shared_ptr<const PngFile> png_;      // of a PNG
  std::shared_ptr<const DepthFile> depth_;  // of neither PNG nor JPEG
};

/// Decodes a file of those kinds, complete or not at all.
/// @param flags  cv::ImreadModes
/// @throws InputError naming the file
[[nodiscard]] cv::Mat read_image(const std::filesystem::path& path, int flags);

/// Writes an image by the extension of `path` (PNG: fast compression), whole or not at all. @throws
/// InputError
void write_image(const std::filesystem::path& path, const cv::Mat& image);

/// PNG files in a folder; 0 where there is no such folder.
[[nodiscard]] std::size_t count_pngs(const std::filesystem::path& folder);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
