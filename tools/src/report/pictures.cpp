// SPDX-License-Identifier: BSD-3-Clause
#include "report/pictures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/frame_stream.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "io/base64.hpp"
#include "io/run_lengths.hpp"
#include "run/evidence_log.hpp"

namespace dynslam::runtime::reporting {
namespace {

constexpr std::size_t kSample = 12;      // frames by which sizes are estimated
constexpr std::size_t kKeypoints = 300;  // of a frame
constexpr double kDepthShare = 0.6;      // of the colour picture's width
constexpr int kMaskWidth = 320;

cv::Size scaled(cv::Size size, int width) {
  width = std::min(width, size.width);
  return {width, std::max(1, static_cast<int>(std::lround(double(width) * size.height / size.width)))};
}

std::string jpeg(const cv::Mat& image, cv::Size size, int quality, int interpolation) {
  cv::Mat small;
  cv::resize(image, small, size, 0, 0, interpolation);
  std::vector<std::uint8_t> bytes;
  cv::imencode(".jpg", small, bytes, {cv::IMWRITE_JPEG_QUALITY, quality});
  return to_base64(bytes);
}

/// Depths as colours, black where there is none.
cv::Mat coloured(const cv::Mat& depth, double near, double far) {
  cv::Mat scale(depth.size(), CV_8UC1), none(depth.size(), CV_8UC1), colours;
  for (int v = 0; v < depth.rows; ++v) {
    for (int u = 0; u < depth.cols; ++u) {
      const float d = depth.at<float>(v, u);
      const bool known = std::isfinite(d) && d > 0;
      none.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(known ? 0 : 255);
      const double share = known ? std::clamp((double(d) - near) / (far - near), 0.0, 1.0) : 0.0;
      scale.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(std::lround(255 * share));
    }
  }
  cv::applyColorMap(scale, colours, cv::COLORMAP_TURBO);
  colours.setTo(cv::Scalar::all(0), none);
  return colours;
}

/// At most kKeypoints: those of low weight first, the others evenly. Four bytes each: u and v of 1/4095 of
/// the image's width and height as 12-bit numbers, and the weight.
json keypoints(const FrameEvidence& frame, cv::Size size, std::size_t& most) {
  if (!frame.judged) return nullptr;
  most = std::max(most, frame.keypoints.size());
  std::vector<EvidenceKeypoint> kept, others;
  for (const EvidenceKeypoint& k : frame.keypoints)
    (k.weight < 128 && kept.size() < kKeypoints / 2 ? kept : others).push_back(k);
  const std::size_t room = kKeypoints - kept.size(), wanted = std::min(room, others.size());
  for (std::size_t i = 0; i < wanted; ++i) kept.push_back(others[i * others.size() / wanted]);
  std::vector<std::uint8_t> bytes;
  for (const EvidenceKeypoint& k : kept) {
    const auto share = [](float at, int length) {
      return static_cast<std::uint32_t>(
          std::clamp(std::lround(4095 * double(at) / std::max(1, length - 1)), 0L, 4095L));
    };
    const std::uint32_t both = share(k.u, size.width) | share(k.v, size.height) << 12U;
    for (const unsigned shift : {0U, 8U, 16U})
      bytes.push_back(static_cast<std::uint8_t>(both >> shift & 255U));
    bytes.push_back(k.weight);
  }
  return to_base64(bytes);
}

/// The value where a mask of a file is set, 0 elsewhere.
cv::Mat set_pixels(const std::filesystem::path& file, std::uint8_t value) {
  cv::Mat values = read_image(file, cv::IMREAD_GRAYSCALE);
  values.setTo(cv::Scalar(value), values != 0);
  return values;
}

json packed(const cv::Mat& values, cv::Size size) {
  cv::Mat small;
  cv::resize(values, small, size, 0, 0, cv::INTER_NEAREST);
  return to_base64(encode_runs(small));
}

}  // namespace

struct Pictures::Picture {
  json colour, depth, truth;
  std::vector<json> masks, keypoints;  // of each run
  std::size_t most_keypoints = 0;
  [[nodiscard]] std::size_t bytes() const {
    std::size_t sum = 0;
    const auto add = [&](const json& text) {
      sum += 4 + (text.is_string() ? text.get_ref<const std::string&>().size() : 0);
    };
    for (const json* one : {&colour, &depth, &truth}) add(*one);
    for (const json& one : masks) add(one);
    for (const json& one : keypoints) add(one);
    return sum;
  }
};

std::vector<PictureLevel> picture_levels(std::size_t frames) {
  constexpr std::array<std::pair<int, int>, 5> kPictures{
      {{480, 75}, {400, 65}, {360, 55}, {320, 50}, {320, 40}}};
  std::vector<PictureLevel> levels;
  for (std::size_t stride = 1; stride < 2 * std::max<std::size_t>(frames, 1); stride += (stride + 1) / 2) {
    for (const auto& [width, quality] : kPictures) levels.push_back({width, quality, stride});
  }
  return levels;
}

Pictures::Pictures(const Source& source) : source_(source) {
  find_depth_range();
}

void Pictures::find_depth_range() {
  std::vector<float> depths;
  const auto& frames = source_.sequence.frames;
  for (std::size_t i = 0; i < frames.size(); i += stride_for(frames.size(), kSample)) {
    try {
      const RgbdFrame frame = decode_frame(frames[i], i, source_.camera);
      for (int v = 0; v < frame.depth.rows; v += 8) {
        for (int u = 0; u < frame.depth.cols; u += 8) {
          const float d = frame.depth.at<float>(v, u);
          if (std::isfinite(d) && d > 0) depths.push_back(d);
        }
      }
    } catch (const InputError&) {  // shown as missing
    }
  }
  if (depths.empty()) return;
  std::sort(depths.begin(), depths.end());
  const auto at = [&](double share) {
    return double(depths[static_cast<std::size_t>(share * static_cast<double>(depths.size() - 1))]);
  };
  near_ = std::floor(10 * at(0.01)) / 10;
  far_ = std::max(near_ + 0.1, std::ceil(10 * at(0.97)) / 10);
}

json Pictures::masks(const RunFolder& run, const std::string& stamp, cv::Size size) const {
  cv::Mat values;
  if (run.evidence) {
    values = run.evidence->masks(stamp);
  } else if (const auto file = run.folder / "masks" / (stamp + ".png"); std::filesystem::exists(file)) {
    values = set_pixels(file, kFusedBit);
  }
  return values.empty() ? json(nullptr) : packed(values, size);
}

Pictures::Picture Pictures::picture(std::size_t index, const PictureLevel& level) const {
  const FrameRecord& record = source_.sequence.frames[index];
  const cv::Size image(source_.camera.width, source_.camera.height);
  const cv::Size size = scaled(image, level.width), mask_size = scaled(image, kMaskWidth);
  Picture result;
  try {
    const RgbdFrame frame = decode_frame(record, index, source_.camera);
    result.colour = jpeg(frame.bgr, size, level.quality, cv::INTER_AREA);
    const cv::Size depth_size = scaled(image, static_cast<int>(kDepthShare * level.width));
    cv::Mat depth;
    cv::resize(frame.depth, depth, depth_size, 0, 0, cv::INTER_NEAREST);
    result.depth = jpeg(coloured(depth, near_, far_), depth_size, level.quality, cv::INTER_NEAREST);
  } catch (const InputError&) {  // a broken frame: the run's problems name it
  }
  if (const auto truth = source_.sequence.root / "dynamic_mask" / (record.stamp + ".png");
      std::filesystem::exists(truth))
    result.truth = packed(set_pixels(truth, 1), mask_size);
  for (const RunFolder& run : source_.runs) {
    result.masks.push_back(masks(run, record.stamp, mask_size));
    json& points = result.keypoints.emplace_back();
    if (!run.evidence) continue;
    const auto known = run.evidence->frames.find(record.stamp);
    if (known != run.evidence->frames.end())
      points = keypoints(known->second, run.evidence->size, result.most_keypoints);
  }
  return result;
}

std::size_t Pictures::estimate(const PictureLevel& level) const {
  const std::size_t frames = source_.sequence.frames.size(), step = stride_for(frames, kSample);
  std::size_t bytes = 0, count = 0;
  for (std::size_t i = 0; i < frames; i += step, ++count) bytes += picture(i, level).bytes();
  constexpr std::size_t kNames = 80;  // stamps, times, states
  return (bytes / count + kNames) * ((frames + level.stride - 1) / level.stride);
}

void Pictures::put(const PictureLevel& level, json& payload, std::vector<std::string>& thinned) const {
  const auto& frames = source_.sequence.frames;
  const cv::Size image(source_.camera.width, source_.camera.height);
  const cv::Size size = scaled(image, level.width), mask_size = scaled(image, kMaskWidth);
  json lists{{"t", json::array()},
             {"stamp", json::array()},
             {"colour", json::array()},
             {"depth", json::array()},
             {"truth", json::array()}};
  std::vector<json> shown(source_.runs.size());
  for (std::size_t r = 0; r < shown.size(); ++r)
    shown[r]["from"] = source_.runs[r].evidence                                    ? "report"
                       : std::filesystem::exists(source_.runs[r].folder / "masks") ? "masks"
                                                                                   : "nothing";
  std::size_t most = 0;
  for (std::size_t i = 0; i < frames.size(); i += level.stride) {
    Picture one = picture(i, level);
    most = std::max(most, one.most_keypoints);
    lists["t"].push_back(number(frames[i].t_rgb - source_.t0, 4));
    lists["stamp"].push_back(frames[i].stamp);
    lists["colour"].push_back(std::move(one.colour));
    lists["depth"].push_back(std::move(one.depth));
    lists["truth"].push_back(std::move(one.truth));
    for (std::size_t r = 0; r < shown.size(); ++r) {
      shown[r]["masks"].push_back(std::move(one.masks[r]));
      shown[r]["keypoints"].push_back(std::move(one.keypoints[r]));
      if (!source_.runs[r].evidence) continue;
      const auto known = source_.runs[r].evidence->frames.find(frames[i].stamp);
      const bool there = known != source_.runs[r].evidence->frames.end();
      shown[r]["state"].push_back(there ? json(known->second.state) : json(nullptr));
      shown[r]["matches"].push_back(there ? json(known->second.matches) : json(nullptr));
      shown[r]["inliers"].push_back(there ? json(known->second.inliers) : json(nullptr));
      shown[r]["keyframe"].push_back(there && known->second.keyframe ? 1 : 0);
    }
  }
  lists["stride"] = level.stride;
  lists["size"] = {size.width, size.height};
  lists["mask_size"] = {mask_size.width, mask_size.height};
  lists["image"] = {image.width, image.height};
  lists["depth_range"] = {near_, far_};
  payload["frames"] = std::move(lists);
  for (std::size_t r = 0; r < shown.size(); ++r) payload["runs"][r]["shown"] = std::move(shown[r]);
  if (level.stride > 1)
    thinned.push_back(fmt::format("pictures: one of {} frames, of {}", level.stride, frames.size()));
  thinned.push_back(fmt::format("pictures are {} x {} of {} x {}, JPEG of quality {}; masks {} x {}",
                                size.width, size.height, image.width, image.height, level.quality,
                                mask_size.width, mask_size.height));
  if (most > kKeypoints)
    thinned.push_back(fmt::format("keypoints: at most {} of up to {} a frame, those of low weight first",
                                  kKeypoints, most));
}

}  // namespace dynslam::runtime::reporting
