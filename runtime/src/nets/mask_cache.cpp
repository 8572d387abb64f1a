// SPDX-License-Identifier: BSD-3-Clause
#include "nets/mask_cache.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/atomic_file.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "io/make_folder.hpp"

namespace dynslam::runtime {
namespace {

/// 64-bit FNV-1a.
class Hash {
 public:
  void add(const void* data, std::size_t size) {
    const auto* bytes = static_cast<const unsigned char*>(data);
    for (std::size_t i = 0; i < size; ++i) value_ = (value_ ^ bytes[i]) * 0x100000001B3ULL;
  }
  void add(std::string_view text) {
    add(text.data(), text.size());
    add("\0", 1);
  }
  [[nodiscard]] std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 0xCBF29CE484222325ULL;
};

std::uint64_t hash_of_model(const SegmenterOptions& o) {
  Hash hash;
  std::ifstream in(o.model, std::ios::binary);
  std::array<char, 65536> block{};
  while (in.read(block.data(), block.size()) || in.gcount() > 0)
    hash.add(block.data(), static_cast<std::size_t>(in.gcount()));
  if (in.bad()) throw InputError(o.model.string(), 0, "cannot be read");
  hash.add(fmt::format("{} {} {} {} {} {} {}", to_string(o.kind), to_string(o.output), o.output_name,
                       o.detection.min_score, o.detection.max_overlap, o.input.width, o.input.height));
  for (const auto& name : o.dynamic_classes) hash.add(name);
  hash.add("|");
  for (const auto& name : o.map_classes) hash.add(name);
  for (std::uint8_t label = 0; label < kMapLabels; ++label)
    if (o.labels.own(label)) hash.add(fmt::format("{} {}", label, o.labels.name(label)));
  return hash.value();
}

// One 16-bit image holds all: bit 15 dynamic, bits 8 to 14 label, bits 0 to 7 instance.
cv::Mat pack(const Masks& masks) {
  cv::Mat packed(masks.dynamic.size(), CV_16UC1);
  for (int v = 0; v < packed.rows; ++v) {
    for (int u = 0; u < packed.cols; ++u) {
      const int instance =
          masks.instances.empty() ? 0 : std::min<int>(255, masks.instances.at<std::uint16_t>(v, u));
      packed.at<std::uint16_t>(v, u) =
          static_cast<std::uint16_t>((masks.dynamic.at<std::uint8_t>(v, u) != 0 ? 0x8000 : 0) |
                                     (masks.labels.at<std::uint8_t>(v, u) << 8) | instance);
    }
  }
  return packed;
}

Masks unpack(const cv::Mat& packed) {
  Masks masks;
  masks.dynamic.create(packed.size(), CV_8UC1);
  masks.labels.create(packed.size(), CV_8UC1);
  masks.instances.create(packed.size(), CV_16UC1);
  bool instances = false;
  for (int v = 0; v < packed.rows; ++v) {
    for (int u = 0; u < packed.cols; ++u) {
      const std::uint16_t p = packed.at<std::uint16_t>(v, u);
      masks.dynamic.at<std::uint8_t>(v, u) = (p & 0x8000) != 0 ? 255 : 0;
      masks.labels.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>((p >> 8) & 0x7F);
      masks.instances.at<std::uint16_t>(v, u) = p & 0xFF;
      instances = instances || (p & 0xFF) != 0;
    }
  }
  if (!instances) masks.instances.release();
  return masks;
}

/// What is kept there; nothing where it is missing or damaged: the network can always be asked again.
std::optional<Masks> cached_masks(const std::filesystem::path& path, const cv::Size& size) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return std::nullopt;
  try {
    const EncodedImage file(path);
    if (file.size() != size) return std::nullopt;
    const cv::Mat packed = file.decode(cv::IMREAD_UNCHANGED);
    if (packed.type() == CV_16UC1) return unpack(packed);
  } catch (const InputError&) {
  }
  return std::nullopt;
}

}  // namespace

MaskCache::MaskCache(std::filesystem::path folder, const OnnxSegmenter& segmenter,
                     const SegmenterOptions& options)
    : folder_(std::move(folder)) {
  make_folder(folder_);
  key_ = fmt::format("{:016x}-{}", hash_of_model(options), segmenter.engine());
}

Masks MaskCache::masks_of(const cv::Mat& bgr, OnnxSegmenter& segmenter) const {
  Hash hash;
  const std::size_t row_bytes = static_cast<std::size_t>(bgr.cols) * bgr.elemSize();
  for (int v = 0; v < bgr.rows; ++v) hash.add(bgr.ptr(v), row_bytes);
  const auto path = folder_ / fmt::format("{}-{:016x}.png", key_, hash.value());
  if (const auto masks = cached_masks(path, bgr.size())) return *masks;
  Masks masks = segmenter.segment(bgr);
  // Several runs may share the folder: each sees whole files alone, whoever writes them.
  std::vector<unsigned char> png;
  cv::imencode(".png", pack(masks), png);
  write_file(path, {reinterpret_cast<const char*>(png.data()), png.size()});
  return masks;
}

}  // namespace dynslam::runtime
