// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/nets/segmentation_stage.hpp"

#include <fmt/format.h>

#include <array>
#include <exception>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <string_view>
#include <utility>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/atomic_file.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "dynslam/runtime/stopwatch.hpp"
#include "io/argument_check.hpp"
#include "threads/thread_priority.hpp"

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
  hash.add(fmt::format("{} {} {} {} {}", to_string(o.kind), o.detection.min_score, o.detection.max_overlap,
                       o.input.width, o.input.height));
  for (const auto& name : o.dynamic_classes) hash.add(name);
  hash.add("|");
  for (const auto& name : o.map_classes) hash.add(name);
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

SegmentationStage::SegmentationStage(FrameStream& frames, const SegmentationStageOptions& options)
    : frames_(frames),
      options_(options),
      segmenter_(options.segmenter),
      keeper_(options.keeper),
      queue_(options.queue) {
  check_argument(options_.every >= 1, "SegmentationStage: `every` must be 1 or more");
  if (!options_.cache.empty()) {
    std::error_code error;
    std::filesystem::create_directories(options_.cache, error);
    if (error) throw InputError(options_.cache.string(), 0, "cannot be made a folder: " + error.message());
    cache_key_ = fmt::format("{:016x}-{}", hash_of_model(options_.segmenter), segmenter_.engine());
  }
  if (options_.async) thread_ = std::jthread([this](const std::stop_token& stop) { work(stop); });
}

Masks SegmentationStage::network_masks(const RgbdFrame& frame) {
  if (cache_key_.empty()) return segmenter_.segment(frame.bgr);
  Hash hash;
  hash.add(frame.bgr.data, frame.bgr.total() * frame.bgr.elemSize());
  const auto path = options_.cache / fmt::format("{}-{:016x}.png", cache_key_, hash.value());
  if (const auto masks = cached_masks(path, frame.bgr.size())) return *masks;
  Masks masks = segmenter_.segment(frame.bgr);
  // Several runs may share the folder: each sees whole files alone, whoever writes them.
  std::vector<unsigned char> png;
  cv::imencode(".png", pack(masks), png);
  write_file(path, {reinterpret_cast<const char*>(png.data()), png.size()});
  return masks;
}

std::optional<SegmentedFrame> SegmentationStage::process() {
  auto next = frames_.next();
  if (!next) return std::nullopt;
  SegmentedFrame out;
  out.frame = std::move(*next);
  if (!out.frame.frame) return out;
  const RgbdFrame& frame = *out.frame.frame;
  Stopwatch watch;
  std::optional<Masks> masks;
  if (out.frame.index % static_cast<std::size_t>(options_.every) == 0) masks = network_masks(frame);
  out.network_ms = watch.lap_ms();
  if (options_.keep) {
    out.masks = keeper_.update(masks, frame.gray, frame.depth);
    out.keeper_ms = watch.lap_ms();
  } else {
    out.masks = std::move(masks);
  }
  return out;
}

std::optional<SegmentedFrame> SegmentationStage::next() {
  return options_.async ? queue_.pop() : process();
}

void SegmentationStage::work(const std::stop_token& stop) {
  step_back(StepBack::far);
  try {
    while (auto frame = process()) {
      if (!queue_.push(std::move(*frame), stop)) return;
    }
    queue_.close();
  } catch (...) {
    queue_.close(std::current_exception());
  }
}

}  // namespace dynslam::runtime
