// SPDX-License-Identifier: BSD-3-Clause
// Mask files of every kind that people save.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "dynslam/runtime/io/image_io.hpp"
#include "png_writer.hpp"

namespace dynslam::test {

using PngPalette = std::vector<std::array<std::uint8_t, 3>>;

/// A PNG of bits that OpenCV cannot write: a palette's indices, or one bit of grey. @param bits  of a pixel:
/// 8 or 1
inline void write_raw_png(const std::filesystem::path& path, const cv::Mat& values, int bits,
                          const PngPalette& palette) {
  std::string rows;
  for (int v = 0; v < values.rows; ++v) {
    rows += '\0';
    unsigned byte = 0;
    for (int u = 0; u < values.cols; ++u) {
      const unsigned value = values.at<std::uint8_t>(v, u);
      byte = byte << static_cast<unsigned>(bits) | value;
      if ((u + 1) * bits % 8 == 0) rows += static_cast<char>(byte & 255U);
    }
  }
  std::string colours;
  for (const auto& c : palette)
    for (const std::uint8_t k : c) colours += static_cast<char>(k);
  std::string header;
  append_number(header, static_cast<std::uint32_t>(values.cols));
  append_number(header, static_cast<std::uint32_t>(values.rows));
  header += static_cast<char>(bits);
  header += static_cast<char>(palette.empty() ? 0 : 3);
  header += std::string(3, '\0');
  std::ofstream(path, std::ios::binary) << std::string("\x89PNG\r\n\x1A\n", 8) << chunk("IHDR", header)
                                        << (palette.empty() ? std::string() : chunk("PLTE", colours))
                                        << chunk("IDAT", zlib_stored(rows)) << chunk("IEND", "");
}

/// The palette of Pascal VOC's label images, by its published list.
inline PngPalette voc_palette() {
  return {{0, 0, 0},     {128, 0, 0},     {0, 128, 0},    {128, 128, 0},   {0, 0, 128},  {128, 0, 128},
          {0, 128, 128}, {128, 128, 128}, {64, 0, 0},     {192, 0, 0},     {64, 128, 0}, {192, 128, 0},
          {64, 0, 128},  {192, 0, 128},   {64, 128, 128}, {192, 128, 128}, {0, 64, 0},   {128, 64, 0},
          {0, 192, 0},   {128, 192, 0},   {0, 64, 128}};
}

/// What stands in a mask file of one size: `left` in a box of a sixteenth of it, `right` in another one, 0
/// around.
inline cv::Mat two_boxes(cv::Size size, int type, double left, double right) {
  cv::Mat image = cv::Mat::zeros(size, type);
  const int w = size.width / 4, h = size.height / 4;
  image(cv::Rect(w / 2, h, w, h)).setTo(cv::Scalar::all(left));
  image(cv::Rect(5 * w / 2, h, w, h)).setTo(cv::Scalar::all(right));
  return image;
}

/// A kind of mask files.
struct MaskFiles {
  std::string name;
  std::function<void(const std::filesystem::path&, cv::Size)> write;
  std::vector<std::string> labels;  ///< --mask-labels
  int boxes = 0;                    ///< of two_boxes() that are dynamic; -1: refused
  std::string line;                 ///< a part of the line that says how they are read, or of the error
};

inline std::vector<MaskFiles> every_kind_of_mask() {
  using std::filesystem::path;
  const auto grey = [](double left, double right, int type = CV_8UC1) {
    return [=](const path& file, cv::Size size) {
      runtime::write_image(file, two_boxes(size, type, left, right));
    };
  };
  const auto indexed = [](int left, int right, const PngPalette& palette, int bits = 8) {
    return [=](const path& file, cv::Size size) {
      write_raw_png(file, two_boxes(size, CV_8UC1, left, right), bits, palette);
    };
  };
  const auto soft = [](const path& file, cv::Size size) {
    cv::Mat image = two_boxes(size, CV_8UC1, 255, 255), rim;
    cv::blur(image, rim, {3, 3});  // 0, 85, 170 and 255: symmetric about the edge
    runtime::write_image(file, rim);
  };
  const auto colours = [](const cv::Scalar& left, const cv::Scalar& right) {
    return [=](const path& file, cv::Size size) {
      cv::Mat image = two_boxes(size, CV_8UC3, 0, 0);
      const cv::Mat a = two_boxes(size, CV_8UC1, 255, 0), b = two_boxes(size, CV_8UC1, 0, 255);
      image.setTo(left, a);
      image.setTo(right, b);
      runtime::write_image(file, image);
    };
  };
  const auto cut_out = [](const path& file, cv::Size size) {
    cv::Mat picture(size, CV_8UC4, cv::Scalar(90, 120, 60, 0));
    picture.setTo(cv::Scalar(90, 120, 60, 255), two_boxes(size, CV_8UC1, 255, 255));
    runtime::write_image(file, picture);
  };
  const auto inverted = [](const path& file, cv::Size size) {
    runtime::write_image(file, cv::Mat(size, CV_8UC1, cv::Scalar(255)));
  };
  const PngPalette black_white{{0, 0, 0}, {255, 255, 255}},
      odd{{10, 0, 0}, {0, 200, 0}, {0, 0, 200}, {9, 9, 99}};
  const PngPalette white_first{{255, 255, 255}, {0, 0, 0}};
  return {
      {"0 and 255", grey(255, 255), {}, 2, "dynamic where 128 or more"},
      {"0 and 128", grey(128, 128), {}, 2, "dynamic where 128 or more"},
      {"0 and 254", grey(254, 254), {}, 2, "dynamic where 128 or more"},
      {"0 and 15", grey(15, 15), {}, 2, "masks of 0 and 15, dynamic where 15"},
      {"a soft rim", soft, {}, 2, "dynamic where 128 or more"},
      {"0 and 1", grey(1, 1), {}, 2, "label images (1 person, 2 chair, 3 display), dynamic where 1"},
      {"own labels", grey(1, 2), {}, 1, "label images (1 person, 2 chair, 3 display), dynamic where 1"},
      {"own labels, nobody there", grey(3, 2), {}, 0, "dynamic where 1"},
      {"other labels",
       grey(15, 9),
       {},
       -1,
       "holds the labels 9, 15, which mean nothing without names; say what they are: --mask-labels "
       "15=person"},
      {"other labels, named",
       grey(15, 9),
       {"15=person", "9=chair"},
       1,
       "--mask-labels: dynamic: person; labels of the map: chair (2)"},
      {"other labels, own class", grey(15, 9), {"15=person", "9=pallet"}, 1, "labels of the map: pallet (4)"},
      {"other labels, by a list", grey(15, 9), {"voc"}, 1, "dynamic: person; labels of the map: chair (2)"},
      {"COCO's numbers", grey(1, 62), {"coco"}, 1, "dynamic: person"},
      {"Cityscapes' numbers", grey(24, 7), {"cityscapes"}, 1, "dynamic: person"},
      {"objects", grey(4, 9), {"instances"}, 2, "--mask-labels"},
      {"all of it", grey(4, 9), {"binary"}, 2, "--mask-labels"},
      {"16-bit instances", grey(300, 7, CV_16UC1), {}, 2, "16-bit instances, dynamic where not 0"},
      {"16-bit masks", grey(65535, 65535, CV_16UC1), {}, 2, "16-bit masks, dynamic where 32768 or more"},
      {"16-bit labels, named", grey(15, 9, CV_16UC1), {"15=person"}, 1, "dynamic: person"},
      {"VOC's palette",
       indexed(15, 9, voc_palette()),
       {},
       1,
       "Pascal VOC's palette; dynamic: person; labels"},
      {"DAVIS' instances", indexed(1, 2, voc_palette()), {}, 2, "instances 1 to 2 in Pascal VOC's colours"},
      {"VOC's colours without the palette",
       colours({128, 128, 192}, {0, 0, 192}),
       {},
       1,
       "palette; dynamic: person; labels of the map: chair (2)"},
      {"a palette of two colours", indexed(1, 1, odd), {}, 2, "the palette's colours 0 and 1"},
      {"a palette of several",
       indexed(1, 3, odd),
       {},
       -1,
       "holds the labels 1, 3 of a palette that is not known"},
      {"a palette, named", indexed(1, 3, odd), {"3=person"}, 1, "dynamic: person"},
      {"1 bit", indexed(1, 1, {}, 1), {}, 2, "dynamic where 128 or more"},
      {"1 bit and a palette", indexed(1, 1, black_white, 1), {}, 2, "dynamic where 128 or more"},
      {"a palette that begins with white", indexed(1, 1, white_first, 1), {}, 0, "dynamic where 128 or more"},
      {"an alpha channel", cut_out, {}, 2, "an alpha channel, dynamic where it is 128 or more"},
      {"grey as colours", colours({255, 255, 255}, {255, 255, 255}), {}, 2, "dynamic where 128 or more"},
      {"one colour",
       colours({0, 0, 255}, {0, 0, 255}),
       {},
       2,
       "masks in one colour, dynamic where not black"},
      {"two colours", colours({0, 0, 255}, {30, 200, 7}), {}, -1, "holds pictures in several colours"},
      {"16-bit colours",
       [](const path& file, cv::Size size) {
         runtime::write_image(file, two_boxes(size, CV_16UC3, 65535, 65535));
       },
       {},
       2,
       "dynamic where 128 or more"},
      {"all empty", grey(0, 0), {}, 0, "nothing is marked in any of"},
      {"the other way round", inverted, {}, -1, "marks every pixel of"},
      {"no name", grey(15, 9), {"15"}, -1, "--mask-labels '15': neither NUMBER=CLASS"},
      {"no number", grey(15, 9), {"999=person"}, -1, "neither NUMBER=CLASS"},
      {"nobody named", grey(15, 9), {"9=chair"}, -1, "--mask-labels has no class 'person'; it has: chair"}};
}

}  // namespace dynslam::test
