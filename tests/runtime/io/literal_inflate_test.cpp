// SPDX-License-Identifier: BSD-3-Clause
#include "io/literal_inflate.hpp"

#include <doctest/doctest.h>
#include <libdeflate.h>

#include <cstddef>
#include <cstdint>
#include <opencv2/imgcodecs.hpp>
#include <random>
#include <span>
#include <string_view>
#include <vector>

// Streams are made by libpng, and compared with what libdeflate makes of them.

namespace {

using dynslam::runtime::LiteralInflater;
using ByteVector = std::vector<std::uint8_t>;

/// The zlib stream of an image's rows.
ByteVector packed_rows(const cv::Mat& image, int strategy) {
  ByteVector png, stream;
  cv::imencode(".png", image, png, {cv::IMWRITE_PNG_COMPRESSION, 6, cv::IMWRITE_PNG_STRATEGY, strategy});
  for (std::size_t at = 8; at + 12 <= png.size();) {
    const std::size_t n = std::size_t{png[at]} << 24 | std::size_t{png[at + 1]} << 16 |
                          std::size_t{png[at + 2]} << 8 | png[at + 3];
    const auto* content = png.data() + at + 8;
    if (std::string_view(reinterpret_cast<const char*>(content - 4), 4) == "IDAT")
      stream.insert(stream.end(), content, content + n);
    at += 12 + n;
  }
  return stream;
}

std::size_t bytes_of_rows(const cv::Mat& image) {
  return static_cast<std::size_t>(image.rows) * (1 + static_cast<std::size_t>(image.cols) * image.elemSize());
}

/// @return nothing where the stream is faulty or of another size
ByteVector by_libdeflate(std::span<const std::uint8_t> stream, std::size_t size) {
  ByteVector out(size);
  auto* inflater = libdeflate_alloc_decompressor();
  const auto result =
      libdeflate_zlib_decompress(inflater, stream.data(), stream.size(), out.data(), size, nullptr);
  libdeflate_free_decompressor(inflater);
  if (result != LIBDEFLATE_SUCCESS) out.clear();
  return out;
}

/// Bytes of which each is half, or another share, as frequent as the one before: codes of every length.
cv::Mat skewed(cv::Size side, unsigned seed, double share) {
  cv::Mat image(side, CV_8UC1);
  std::mt19937 random(seed);
  for (int v = 0; v < side.height; ++v) {
    for (int u = 0; u < side.width; ++u) {
      int value = 0;
      while (value < 255 && static_cast<double>(random() & 0xFFFF) < share * 65536) ++value;
      image.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(value);
    }
  }
  return image;
}

}  // namespace

TEST_CASE("streams of literals are read as by libdeflate") {
  LiteralInflater inflater;
  int read = 0;
  for (const double share : {0.02, 0.3, 0.5, 0.7, 0.9, 0.99}) {
    for (const cv::Size side : {cv::Size(40, 3), {64, 48}, {333, 217}, {640, 480}}) {
      const cv::Mat image = skewed(side, static_cast<unsigned>(side.width), share);
      const auto stream = packed_rows(image, cv::IMWRITE_PNG_STRATEGY_HUFFMAN_ONLY);
      const std::size_t size = bytes_of_rows(image);
      const auto expected = by_libdeflate(stream, size);
      REQUIRE(expected.size() == size);
      ByteVector out(size);
      CAPTURE(share);
      CAPTURE(side.width);
      const bool ok = inflater.decompress(stream, out);
      if (side.width >= 64) CHECK(ok);  // zlib takes its fixed codes for what is small
      if (ok) CHECK(out == expected);
      read += ok ? 1 : 0;
    }
  }
  CHECK(read >= 18);
}

TEST_CASE("what is no stream of literals, of another size or damaged is left alone") {
  LiteralInflater inflater;
  const cv::Mat image = skewed({64, 48}, 5, 0.6);
  const std::size_t size = bytes_of_rows(image);
  for (const int strategy : {cv::IMWRITE_PNG_STRATEGY_DEFAULT, cv::IMWRITE_PNG_STRATEGY_FIXED}) {
    ByteVector out(size);
    CHECK_FALSE(inflater.decompress(packed_rows(image, strategy), out));
  }
  const auto stream = packed_rows(image, cv::IMWRITE_PNG_STRATEGY_HUFFMAN_ONLY);
  const auto expected = by_libdeflate(stream, size);
  for (const std::size_t other : {std::size_t{0}, std::size_t{1}, size - 9, size - 1, size + 1, size + 300}) {
    ByteVector out(other);
    CHECK_FALSE(inflater.decompress(stream, out));
  }
  for (std::size_t n = 0; n < stream.size(); ++n) {
    ByteVector out(size);
    const ByteVector part(stream.begin(), stream.begin() + static_cast<std::ptrdiff_t>(n));
    CHECK_FALSE(inflater.decompress(part, out));
  }
  for (std::size_t at = 0; at < stream.size(); ++at) {
    for (const unsigned bit : {0U, 3U, 6U}) {
      ByteVector bad = stream, out(size);
      bad[at] = static_cast<std::uint8_t>(bad[at] ^ 1U << bit);
      const bool ok = inflater.decompress(bad, out);
      CAPTURE(at);
      CHECK((!ok || (out == expected && by_libdeflate(bad, size) == expected)));  // bits that say nothing
    }
  }
}
