// SPDX-License-Identifier: BSD-3-Clause
#include "io/png_decoder.hpp"

#ifdef __x86_64__
#include <tmmintrin.h>
#endif

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdlib>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <string_view>
#include <utility>

#include "io/zlib_stream.hpp"

namespace dynslam::runtime {
namespace {

using PngBytes = std::span<const std::uint8_t>;

constexpr std::size_t kSignature = 8, kChunkFrame = 12;  // length, name and check sum of a chunk

std::uint32_t big_endian(PngBytes bytes, std::size_t at) {
  return std::uint32_t{bytes[at]} << 24 | std::uint32_t{bytes[at + 1]} << 16 |
         std::uint32_t{bytes[at + 2]} << 8 | std::uint32_t{bytes[at + 3]};
}

/// What the header says; whether rows are stored so that they can be read at once.
void read_header(PngBytes header, PngFile& file) {
  const auto side = [&](std::size_t at) {
    return static_cast<int>(std::min<std::uint32_t>(big_endian(header, at), std::numeric_limits<int>::max()));
  };
  constexpr int kGrey = 0, kColour = 2, kIndexed = 3;
  file.size = {side(0), side(4)};
  file.bits = header[8];
  const int kind = header[9], compression = header[10], filters = header[11], interlaced = header[12];
  file.indexed = kind == kIndexed;
  file.channels = kind == kGrey ? 1 : kind == kColour ? 3 : 0;
  const bool known =
      (kind == kGrey && (file.bits == 8 || file.bits == 16)) || (kind == kColour && file.bits == 8);
  file.plain = known && compression == 0 && filters == 0 && interlaced == 0 && file.size.width > 0 &&
               file.size.height > 0;
}

void read_palette(PngBytes entries, PngFile& file) {
  for (std::size_t at = 0; at + 3 <= entries.size(); at += 3)
    file.palette.push_back({entries[at], entries[at + 1], entries[at + 2]});
}

// --- filters: what a row holds is the difference to a prediction (the PNG specification, 9.2)
// ----------------------

int paeth(int left, int up, int corner) {
  const int to_left = std::abs(up - corner), to_up = std::abs(left - corner);
  const int to_corner = std::abs(left + up - 2 * corner);
  return to_left <= to_up && to_left <= to_corner ? left : to_up <= to_corner ? up : corner;
}

#ifdef __x86_64__
/// Adds to each byte that of the pixel before, 16 bytes at a time: shifted sums within them, and to all of
/// them the last pixel of those before.
/// @return pixels that are done; those at the end of the row are not
template <int PixelBytes>
[[gnu::target("ssse3")]] std::size_t add_left_pixels(std::uint8_t* row, std::size_t pixels) {
  constexpr int kPixels = 16 / PixelBytes, kLast = (kPixels - 1) * PixelBytes;
  const auto load = [](const std::uint8_t* at) {
    return _mm_loadu_si128(reinterpret_cast<const __m128i*>(at));
  };
  const auto store = [](std::uint8_t* at, __m128i bytes) {
    _mm_storeu_si128(reinterpret_cast<__m128i*>(at), bytes);
  };
  std::array<std::uint8_t, 16> from_last;
  for (std::size_t i = 0; i < 16; ++i) from_last[i] = static_cast<std::uint8_t>(kLast + i % PixelBytes);
  const __m128i spread = load(from_last.data());
  __m128i before = _mm_setzero_si128();
  std::size_t done = 0;
  if (pixels < 3 * kPixels) return 0;
  __m128i next = load(row);
  for (; done + 3 * kPixels <= pixels; done += kPixels, row += kPixels * PixelBytes) {
    __m128i sum = next;
    next = load(row + kPixels * PixelBytes);  // before a byte too many is stored there
    sum = _mm_add_epi8(sum, _mm_slli_si128(sum, PixelBytes));
    sum = _mm_add_epi8(sum, _mm_slli_si128(sum, 2 * PixelBytes));
    sum = _mm_add_epi8(sum, _mm_slli_si128(sum, 4 * PixelBytes));
    if constexpr (PixelBytes == 1) sum = _mm_add_epi8(sum, _mm_slli_si128(sum, 8));
    sum = _mm_add_epi8(sum, before);
    before = _mm_shuffle_epi8(sum, spread);
    store(row, sum);
  }
  store(row, next);
  return done;
}
bool adds_left_pixels() {
  static const bool can = __builtin_cpu_supports("ssse3") != 0;
  return can;
}
#endif

/// Adds what `predict(left, up, corner)` says to each byte. The bytes of a pixel are kept in registers: each
/// depends on that of the pixel before.
template <int PixelBytes, class Predict>
void undo(std::uint8_t* row, const std::uint8_t* above, std::size_t pixels, const Predict& predict,
          std::array<int, PixelBytes> left = {}) {
  std::array<int, PixelBytes> corner{};
  for (std::size_t x = 0; x < pixels; ++x, row += PixelBytes, above += PixelBytes) {
    for (int k = 0; k < PixelBytes; ++k) {
      const auto i = static_cast<std::size_t>(k);
      const int up = above[i];
      left[i] = (row[i] + predict(left[i], up, corner[i])) & 0xFF;
      row[i] = static_cast<std::uint8_t>(left[i]);
      corner[i] = up;
    }
  }
}

template <int PixelBytes>
void undo_left(std::uint8_t* row, const std::uint8_t* above, std::size_t pixels) {
  std::size_t done = 0;
#ifdef __x86_64__
  if (adds_left_pixels()) done = add_left_pixels<PixelBytes>(row, pixels);
#endif
  row += done * PixelBytes;
  std::array<int, PixelBytes> left{};
  if (done > 0) std::copy(row - PixelBytes, row, left.begin());
  undo<PixelBytes>(
      row, above, pixels - done, [](int before, int, int) { return before; }, left);
}

/// @param row  as stored, then as it was @param above  the row above, zeros where there is none
template <int PixelBytes>
bool unfilter(int filter, std::uint8_t* row, const std::uint8_t* above, std::size_t pixels) {
  switch (filter) {
    case 0:
      return true;
    case 1:
      undo_left<PixelBytes>(row, above, pixels);
      return true;
    case 2:
      for (std::size_t i = 0; i < pixels * PixelBytes; ++i)
        row[i] = static_cast<std::uint8_t>(row[i] + above[i]);
      return true;
    case 3:
      undo<PixelBytes>(row, above, pixels, [](int left, int up, int) { return (left + up) / 2; });
      return true;
    case 4:
      undo<PixelBytes>(row, above, pixels, paeth);
      return true;
    default:
      return false;
  }
}

/// @param rows  `height` times a byte that names the filter and the row's bytes
template <int PixelBytes>
bool unfilter_rows(std::uint8_t* rows, std::size_t width, std::size_t height) {
  const std::size_t row_bytes = width * PixelBytes;
  const std::vector<std::uint8_t> zeros(row_bytes, 0);
  const std::uint8_t* above = zeros.data();
  for (std::size_t y = 0; y < height; ++y, rows += row_bytes + 1) {
    if (!unfilter<PixelBytes>(*rows, rows + 1, above, width)) return false;
    above = rows + 1;
  }
  return true;
}

// ---------------------------------------------------------------------------------------------------------------

/// What a thread that decodes frame by frame need not ask for again.
struct Scratch {
  ZlibInflater inflate;
  std::vector<PngBytes> parts;
  std::vector<std::uint8_t> rows;
};

/// @param size  of all filtered rows [bytes], which scratch.rows then holds
bool decompress(PngBytes bytes, const PngFile& file, std::size_t size, Scratch& scratch, std::string& fault) {
  scratch.parts.clear();
  for (const PngFile::Part& part : file.data) scratch.parts.push_back(bytes.subspan(part.at, part.length));
  scratch.rows.resize(size);
  switch (scratch.inflate(scratch.parts, scratch.rows)) {
    case Inflated::whole:
      return true;
    case Inflated::too_long:
      return false;  // more than the image has: libpng warns and reads it
    case Inflated::too_short:
      fault = "it holds fewer rows than it says";
      return false;
    case Inflated::broken:
      break;
  }
  fault = "its rows cannot be decompressed";
  return false;
}

cv::Mat grey16(const std::uint8_t* rows, cv::Size size) {
  cv::Mat image(size, CV_16UC1);
  const auto width = static_cast<std::size_t>(size.width);
  for (int y = 0; y < size.height; ++y, rows += 2 * width + 1) {
    auto* out = image.ptr<std::uint16_t>(y);
    const std::uint8_t* in = rows + 1;
    for (std::size_t x = 0; x < width; ++x)
      out[x] = static_cast<std::uint16_t>(in[2 * x] << 8 | in[2 * x + 1]);
  }
  return image;
}

}  // namespace

PngFile open_png(PngBytes bytes, int longest_side) {
  PngFile file;
  const auto fails = [&](std::string reason) {
    file.fault = std::move(reason);
    file.plain = false;
    return file;
  };
  bool special = false;  // something that changes what the rows mean
  for (std::size_t at = kSignature; at < bytes.size();) {
    if (bytes.size() - at < kChunkFrame) return fails("its last chunk is cut off");
    const std::size_t length = big_endian(bytes, at);
    const std::string_view name(reinterpret_cast<const char*>(bytes.data() + at + 4), 4);
    if (at == kSignature) {
      if (name != "IHDR" || length != 13 || bytes.size() < at + kChunkFrame + length)
        return fails("it has no header");
      read_header(bytes.subspan(at + 8, length), file);
      if (std::max(file.size.width, file.size.height) > longest_side) return file;
    }
    if (length > bytes.size() - at - kChunkFrame) return fails("its last chunk is cut off");
    const bool critical = (name[0] & 0x20) == 0;
    if (critical && crc32(bytes.subspan(at + 4, length + 4)) != big_endian(bytes, at + 8 + length))
      return fails("the check sum of its chunk " + std::string(name) + " differs");
    if (name == "IEND") break;
    if (name == "IDAT") file.data.push_back({at + 8, length});
    if (name == "PLTE" && file.indexed) read_palette(bytes.subspan(at + 8, length), file);
    special = special || name == "tRNS" || (critical && name != "IHDR" && name != "PLTE" && name != "IDAT");
    at += kChunkFrame + length;
  }
  if (file.data.empty()) return fails("it has no pixels");
  file.plain = file.plain && !special;
  return file;
}

cv::Mat decode_plain_png(PngBytes bytes, const PngFile& file, std::string& fault) {
  thread_local Scratch scratch;
  const auto width = static_cast<std::size_t>(file.size.width),
             height = static_cast<std::size_t>(file.size.height);
  const std::size_t pixel = static_cast<std::size_t>(file.channels * file.bits / 8), row = width * pixel + 1;
  if (!decompress(bytes, file, row * height, scratch, fault)) return {};
  std::uint8_t* rows = scratch.rows.data();
  const bool known = pixel == 1   ? unfilter_rows<1>(rows, width, height)
                     : pixel == 2 ? unfilter_rows<2>(rows, width, height)
                                  : unfilter_rows<3>(rows, width, height);
  if (!known) {
    fault = "a row has an unknown filter";
    return {};
  }
  if (pixel == 2) return grey16(rows, file.size);
  const cv::Mat stored(file.size, pixel == 1 ? CV_8UC1 : CV_8UC3, rows + 1, row);
  cv::Mat image;
  if (pixel == 1) {
    stored.copyTo(image);
  } else {
    cv::cvtColor(stored, image, cv::COLOR_RGB2BGR);
  }
  return image;
}

}  // namespace dynslam::runtime
