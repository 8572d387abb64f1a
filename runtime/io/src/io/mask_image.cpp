// SPDX-License-Identifier: BSD-3-Clause
#include "io/mask_image.hpp"

#include <algorithm>
#include <cstddef>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <unordered_map>

namespace dynslam::runtime {
namespace {

using Palette = std::vector<std::array<std::uint8_t, 3>>;

constexpr int kVocClasses = 21, kVocVoid = 255, kHalf = 128;
constexpr std::size_t kMostColours = 16;  // that are told apart where none is known

/// Colour of a class in Pascal VOC's label images: its bits are dealt to the channels, the highest ones
/// first.
std::array<std::uint8_t, 3> voc_colour(int index) {
  unsigned rgb[3] = {0, 0, 0};
  for (unsigned bit = 0; bit < 8; ++bit)
    for (unsigned c = 0; c < 3; ++c)
      rgb[c] |= (static_cast<unsigned>(index) >> (3 * bit + c) & 1U) << (7 - bit);
  return {static_cast<std::uint8_t>(rgb[0]), static_cast<std::uint8_t>(rgb[1]),
          static_cast<std::uint8_t>(rgb[2])};
}

int key(std::uint8_t red, std::uint8_t green, std::uint8_t blue) {
  return red << 16 | green << 8 | blue;
}

/// Index of each colour, the first of those that have it.
std::unordered_map<int, int> indices_of(const Palette& palette) {
  std::unordered_map<int, int> index;
  for (std::size_t i = 0; i < palette.size(); ++i)
    index.emplace(key(palette[i][0], palette[i][1], palette[i][2]), static_cast<int>(i));
  return index;
}

/// Images of one channel from the colours; false where one is not in the table.
bool look_up(const cv::Mat& bgr, const std::unordered_map<int, int>& table, cv::Mat& out) {
  out.create(bgr.size(), CV_8UC1);
  int last = -1, value = 0;
  for (int v = 0; v < bgr.rows; ++v) {
    const auto* in = bgr.ptr<cv::Vec3b>(v);
    auto* to = out.ptr<std::uint8_t>(v);
    for (int u = 0; u < bgr.cols; ++u) {
      const int colour = key(in[u][2], in[u][1], in[u][0]);
      if (colour != last) {
        const auto found = table.find(colour);
        if (found == table.end()) return false;
        last = colour;
        value = found->second;
      }
      to[u] = static_cast<std::uint8_t>(value);
    }
  }
  return true;
}

bool is_grey(const cv::Mat& bgr) {
  cv::Mat channels[3];
  cv::split(bgr, channels);
  return cv::norm(channels[0], channels[1], cv::NORM_INF) == 0 &&
         cv::norm(channels[0], channels[2], cv::NORM_INF) == 0;
}

bool is_voc(const Palette& palette) {
  if (palette.size() < static_cast<std::size_t>(kVocClasses)) return false;
  for (int i = 0; i < kVocClasses; ++i)
    if (palette[static_cast<std::size_t>(i)] != voc_colour(i)) return false;
  return true;
}

/// As a VOC label image that lost its palette, or as what is black and what is not.
MaskImage from_colours(const cv::Mat& bgr) {
  static const std::unordered_map<int, int> voc = [] {
    Palette palette;
    for (int i = 0; i < kVocClasses; ++i) palette.push_back(voc_colour(i));
    auto table = indices_of(palette);
    const auto edge = voc_colour(kVocVoid);
    table.emplace(key(edge[0], edge[1], edge[2]), kVocVoid);
    return table;
  }();
  MaskImage image{MaskStorage::indexed, {}, true};
  if (look_up(bgr, voc, image.values)) return image;
  image = {MaskStorage::colour, cv::Mat::zeros(bgr.size(), CV_8UC1), false};
  for (int v = 0; v < bgr.rows; ++v) {
    const auto* in = bgr.ptr<cv::Vec3b>(v);
    for (int u = 0; u < bgr.cols; ++u) {
      const int colour = key(in[u][2], in[u][1], in[u][0]);
      if (colour == 0) continue;
      image.values.at<std::uint8_t>(v, u) = 255;
      auto& seen = image.colours;
      if (seen.size() < kMostColours && std::find(seen.begin(), seen.end(), colour) == seen.end())
        seen.push_back(colour);
    }
  }
  std::sort(image.colours.begin(), image.colours.end());
  return image;
}

}  // namespace

std::string_view to_string(MaskStorage storage) {
  constexpr std::array<std::string_view, 5> kNames{"8-bit grey", "a palette", "16-bit grey", "colours",
                                                   "an alpha channel"};
  return kNames[static_cast<std::size_t>(storage)];
}

MaskImage read_mask_image(const EncodedImage& file, bool by_index) {
  cv::Mat image = file.decode(cv::IMREAD_UNCHANGED);
  if (image.type() == CV_16UC1) return {MaskStorage::deep, image, false};
  if (image.depth() == CV_32F) image = image >= 0.5;  // what a TIFF or an array holds as shares
  constexpr double kTo8 = 1.0 / 257;
  if (image.depth() == CV_16U) image.convertTo(image, CV_8U, kTo8);
  const Palette palette = file.palette();
  if (image.channels() == 4) {
    cv::Mat alpha;
    cv::extractChannel(image, alpha, 3);
    if (palette.empty() && cv::countNonZero(alpha != 255) > 0) return {MaskStorage::alpha, alpha, false};
    cv::cvtColor(image, image, cv::COLOR_BGRA2BGR);
  }
  MaskImage result{MaskStorage::indexed, {}, is_voc(palette)};
  if (image.channels() == 3) {
    const bool grey = is_grey(image);
    if (!palette.empty() && (by_index || !grey) && look_up(image, indices_of(palette), result.values))
      return result;
    if (!grey && !file.is_jpeg()) return from_colours(image);
    cv::cvtColor(image, image, cv::COLOR_BGR2GRAY);
  }
  if (file.is_jpeg()) image = image >= kHalf;  // its rims are never what was drawn
  return {MaskStorage::grey, image, false};
}

}  // namespace dynslam::runtime
