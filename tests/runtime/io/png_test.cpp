// SPDX-License-Identifier: BSD-3-Clause
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <opencv2/imgcodecs.hpp>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "io/png_decoder.hpp"
#include "png_writer.hpp"

// PNG files are made here byte by byte, with every filter, and compared with what OpenCV (libpng) reads.

namespace {

using namespace dynslam::runtime;

using dynslam::test::append_number, dynslam::test::chunk, dynslam::test::zlib_stored;

struct Kind {
  const char* name;
  int bits, type;  // of IHDR
  std::size_t pixel;
  int read;
};
constexpr std::array<Kind, 4> kKinds{{{"grey, 8 bits", 8, 0, 1, cv::IMREAD_UNCHANGED},
                                      {"grey, 16 bits", 16, 0, 2, cv::IMREAD_UNCHANGED},
                                      {"colour", 8, 2, 3, cv::IMREAD_COLOR},
                                      {"colour and opacity", 8, 6, 4, cv::IMREAD_UNCHANGED}}};

struct Made {
  std::string header, rows, extra;
  std::size_t part = 777;  // bytes in each chunk of data
  [[nodiscard]] std::string file() const { return file_of(zlib_stored(rows)); }
  [[nodiscard]] std::string file_of(const std::string& packed) const {
    std::string out("\x89PNG\r\n\x1A\n", 8);
    out += chunk("IHDR", header) + extra;
    for (std::size_t at = 0; at < packed.size(); at += part) out += chunk("IDAT", packed.substr(at, part));
    return out + chunk("IEND", "");
  }
};

std::string header_of(const Kind& kind, unsigned width, unsigned height) {
  std::string header;
  append_number(header, width);
  append_number(header, height);
  header += static_cast<char>(kind.bits);
  header += static_cast<char>(kind.type);
  return header + std::string(3, '\0');
}

/// Random bytes: as the differences to a prediction they are as good as any. @param filter  of all rows; 5:
/// any
Made made(const Kind& kind, unsigned width, unsigned height, int filter) {
  Made png;
  png.header = header_of(kind, width, height);
  std::mt19937 random(width * 31 + height * 7 + static_cast<unsigned>(filter));
  for (unsigned y = 0; y < height; ++y) {
    png.rows += static_cast<char>(filter < 5 ? filter : static_cast<int>(random() % 5));
    for (std::size_t i = 0; i < width * kind.pixel; ++i) png.rows += static_cast<char>(random() & 0xFF);
  }
  return png;
}

cv::Mat by_opencv(const std::string& file, int flags) {
  return cv::imdecode(std::vector<char>(file.begin(), file.end()), flags);
}

/// The compressed rows of a PNG that OpenCV wrote.
std::string packed_rows(const cv::Mat& image, int level) {
  std::vector<std::uint8_t> file;
  cv::imencode(".png", image, file, {cv::IMWRITE_PNG_COMPRESSION, level});
  std::string packed;
  for (const PngFile::Part& part : open_png(file, std::max(image.cols, image.rows)).data)
    packed.append(reinterpret_cast<const char*>(file.data()) + part.at, part.length);
  return packed;
}

std::string in_parts(const cv::Mat& image, const std::string& packed, std::size_t part) {
  Made png;
  png.header = header_of(kKinds[1], static_cast<unsigned>(image.cols), static_cast<unsigned>(image.rows));
  png.part = part;
  return png.file_of(packed);
}

/// Depth of a slanted wall with noise, larger than the 32 KiB that a stream looks back.
cv::Mat wall() {
  cv::Mat image(160, 200, CV_16UC1);
  std::mt19937 random(3);
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u)
      image.at<std::uint16_t>(v, u) =
          static_cast<std::uint16_t>(5000 + 20 * u + 7 * v + static_cast<int>(random() % 8));
  }
  return image;
}

bool same(const cv::Mat& a, const cv::Mat& b) {
  return !a.empty() && a.size() == b.size() && a.type() == b.type() && cv::norm(a, b, cv::NORM_INF) == 0;
}

std::string refusal(const std::string& file, int flags = cv::IMREAD_UNCHANGED) {
  try {
    (void)EncodedImage("a.png", file).decode(flags);
  } catch (const InputError& error) {
    return error.what();
  }
  return {};
}

}  // namespace

TEST_CASE("a PNG is read as by OpenCV: every kind, filter and size") {
  for (const Kind& kind : kKinds) {
    CAPTURE(kind.name);
    for (int filter = 0; filter <= 5; ++filter) {
      CAPTURE(filter);
      for (const auto& [width, height] : {std::array{1U, 1U}, {1U, 9U}, {13U, 2U}, {64U, 48U}, {131U, 57U}}) {
        const std::string file = made(kind, width, height, filter).file();
        for (const int flags : {kind.read, +cv::IMREAD_GRAYSCALE, +cv::IMREAD_UNCHANGED})
          CHECK(same(EncodedImage("a.png", file).decode(flags), by_opencv(file, flags)));
      }
    }
  }
}

TEST_CASE("compressed rows may be cut anywhere into parts") {
  const cv::Mat image = wall();
  for (const int level : {1, 6, 9}) {
    CAPTURE(level);
    const std::string packed = packed_rows(image, level);
    REQUIRE(packed.size() > 10000);
    for (const std::size_t part : {packed.size(), packed.size() - 1, packed.size() - 4, std::size_t{8192},
                                   std::size_t{777}, std::size_t{3}, std::size_t{1}}) {
      CAPTURE(part);
      CHECK(same(EncodedImage("a.png", in_parts(image, packed, part)).decode(cv::IMREAD_UNCHANGED), image));
    }
  }
}

TEST_CASE("a stream that ends early or is changed gives no other picture, whatever the chunks' sums say") {
  const cv::Mat image = wall();
  const std::string packed = packed_rows(image, 6);
  for (std::size_t length = 1; length < packed.size(); length += length < packed.size() - 40 ? 997 : 1) {
    CAPTURE(length);
    for (const std::size_t part : {packed.size(), std::size_t{500}})
      CHECK_FALSE(refusal(in_parts(image, packed.substr(0, length), part)).empty());
  }
  for (std::size_t at = 2; at < packed.size(); at += 211) {
    CAPTURE(at);
    std::string changed = packed;
    changed[at] = static_cast<char>(changed[at] ^ 1 << at % 8);
    CHECK_FALSE(refusal(in_parts(image, changed, 3000)).empty());
  }
}

TEST_CASE("what changes the meaning of a PNG's rows is left to libpng, and surplus rows are no fault") {
  Made png = made(kKinds[0], 20, 10, 4);
  png.extra = chunk("tRNS", std::string("\0\7", 2));
  CHECK(same(EncodedImage("a.png", png.file()).decode(cv::IMREAD_UNCHANGED),
             by_opencv(png.file(), cv::IMREAD_UNCHANGED)));
  png.extra = chunk("tEXt", std::string("Comment\0a camera", 16));
  CHECK(same(EncodedImage("a.png", png.file()).decode(cv::IMREAD_UNCHANGED),
             by_opencv(png.file(), cv::IMREAD_UNCHANGED)));
  png.rows += std::string(21, '\0');
  CHECK(same(EncodedImage("a.png", png.file()).decode(cv::IMREAD_UNCHANGED),
             by_opencv(png.file(), cv::IMREAD_UNCHANGED)));
}

TEST_CASE("a PNG of which a byte differs is refused with the reason, never half a picture") {
  const std::string good = made(kKinds[1], 12, 8, 5).file();
  const cv::Mat expected = by_opencv(good, cv::IMREAD_UNCHANGED);
  for (std::size_t at = 0; at < good.size(); ++at) {
    std::string bad = good;
    bad[at] = static_cast<char>(bad[at] ^ 0x10);
    CAPTURE(at);
    CHECK_FALSE(refusal(bad).empty());
  }
  Made png = made(kKinds[1], 12, 8, 5);
  png.rows.resize(png.rows.size() - 25);
  CHECK(refusal(png.file()) == "a.png: is damaged: it holds fewer rows than it says");
  png = made(kKinds[1], 12, 8, 5);
  png.rows[0] = 9;
  CHECK(refusal(png.file()) == "a.png: is damaged: a row has an unknown filter");
  CHECK(refusal(good.substr(0, 33) + chunk("IDAT", "no rows") + chunk("IEND", "")) ==
        "a.png: is damaged: its rows cannot be decompressed");
  CHECK(refusal(good.substr(0, 33) + chunk("IEND", "")) == "a.png: is damaged: it has no pixels");
  CHECK(refusal(good.substr(0, 8) + chunk("IEND", "")) == "a.png: is damaged: it has no header");
  std::string longer = good;
  longer[33] = '\x7F';  // the length of the first part of the data
  CHECK(refusal(longer) == "a.png: is damaged: its last chunk is cut off");
}
