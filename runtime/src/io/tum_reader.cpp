// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/io/tum_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <new>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <sstream>
#include <string_view>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "dynslam/runtime/io/read_file.hpp"
#include "dynslam/runtime/io/text_lines.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"
#include "io/argument_check.hpp"
#include "io/frame_of_images.hpp"
#include "threads/thread_priority.hpp"

namespace dynslam::runtime {
namespace {

namespace fs = std::filesystem;

double parse_stamp(std::string_view word, const std::string& name, std::size_t line) {
  const auto t = parse_number(word);
  if (!t || *t < 0) throw InputError(name, line, fmt::format("'{}' is not a time stamp", word));
  return *t;
}

void check_increasing(double previous, double t, const std::string& name, std::size_t line) {
  if (t == previous) throw InputError(name, line, "the time stamp occurs twice");
  if (t < previous) throw InputError(name, line, "the time stamps are not sorted");
}

std::vector<ListEntry> read_list(const fs::path& path) {
  std::istringstream in(read_file(path));
  auto list = parse_list(in, path.string());
  if (list.empty()) throw InputError(path.string(), 0, "lists no images");
  return list;
}

/// TUM names the camera in its folder names: rgbd_dataset_freiburg1_xyz, fr1_xyz.
std::string guess_camera(const fs::path& root) {
  if (fs::exists(root / "camera.txt")) return (root / "camera.txt").string();
  fs::path folder = fs::absolute(root).lexically_normal();
  if (!folder.has_filename()) folder = folder.parent_path();
  const std::string name = folder.filename().string();
  for (const char digit : {'1', '2', '3'}) {
    if (name.find(std::string("freiburg") + digit) != std::string::npos ||
        name.starts_with(std::string("fr") + digit)) {
      return std::string("fr") + digit;
    }
  }
  return {};
}

}  // namespace

std::vector<ListEntry> parse_list(std::istream& in, const std::string& name) {
  std::vector<ListEntry> list;
  LineReader reader(in);
  while (reader.next()) {
    const auto words = split_words(reader.line());
    if (words.size() != 2) {
      throw InputError(name, reader.number(),
                       fmt::format("expected 2 columns (timestamp file), found {}", words.size()));
    }
    const double t = parse_stamp(words[0], name, reader.number());
    if (!list.empty()) check_increasing(list.back().t, t, name, reader.number());
    list.push_back({t, std::string(words[0]), std::string(words[1])});
  }
  if (in.bad()) throw InputError(name, 0, "cannot be read");
  return list;
}

std::vector<FrameRecord> parse_associations(std::istream& in, const std::string& name) {
  std::vector<FrameRecord> frames;
  LineReader reader(in);
  while (reader.next()) {
    const auto words = split_words(reader.line());
    if (words.size() != 4) {
      throw InputError(
          name, reader.number(),
          fmt::format("expected 4 columns (rgb time, rgb file, depth time, depth file), found {}",
                      words.size()));
    }
    FrameRecord record;
    record.t_rgb = parse_stamp(words[0], name, reader.number());
    record.t_depth = parse_stamp(words[2], name, reader.number());
    if (!frames.empty()) check_increasing(frames.back().t_rgb, record.t_rgb, name, reader.number());
    record.stamp = words[0];
    record.rgb = words[1];
    record.depth = words[3];
    frames.push_back(std::move(record));
  }
  if (in.bad()) throw InputError(name, 0, "cannot be read");
  return frames;
}

Sequence load_sequence(const fs::path& root, const SequenceOptions& options) {
  if (!fs::is_directory(root)) throw InputError(root.string(), 0, "is not a folder");
  Sequence sequence;
  sequence.root = root;
  if (const fs::path path = root / "associations.txt"; fs::exists(path)) {
    std::istringstream in(read_file(path));
    sequence.frames = parse_associations(in, path.string());
    if (sequence.frames.empty()) throw InputError(path.string(), 0, "lists no images");
  } else {
    const auto rgb = read_list(root / "rgb.txt"), depth = read_list(root / "depth.txt");
    std::vector<double> t_rgb, t_depth;
    for (const auto& e : rgb) t_rgb.push_back(e.t);
    for (const auto& e : depth) t_depth.push_back(e.t);
    for (const auto& [i, j] : associate(t_rgb, t_depth, options.max_association_difference)) {
      sequence.frames.push_back({rgb[i].t, depth[j].t, rgb[i].stamp, rgb[i].path, depth[j].path});
    }
    if (sequence.frames.empty()) {
      throw InputError(
          root.string(), 0,
          fmt::format("no colour image has a depth image within {} s", options.max_association_difference));
    }
  }
  for (FrameRecord& record : sequence.frames) {
    record.rgb = root / record.rgb;
    record.depth = root / record.depth;
  }
  if (options.max_frames > 0 && sequence.frames.size() > options.max_frames)
    sequence.frames.resize(options.max_frames);
  if (const fs::path path = root / "groundtruth.txt"; fs::exists(path))
    sequence.groundtruth = read_trajectory(path);
  sequence.camera_hint = guess_camera(root);
  return sequence;
}

RgbdFrame decode_frame(const FrameRecord& record, std::size_t index, const CameraConfig& camera) {
  (void)checked(camera);
  const auto decode = [&](const fs::path& path, int flags) {
    const EncodedImage image(path);
    if (const cv::Size size = image.size(); size != cv::Size(camera.width, camera.height)) {
      throw InputError(path.string(), 0,
                       fmt::format("is {}x{}, the camera's images are {}x{}", size.width, size.height,
                                   camera.width, camera.height));
    }
    return image.decode(flags);
  };
  RgbdFrame frame;
  frame.index = index;
  frame.t = record.t_rgb;
  frame.depth_delay = record.t_depth - record.t_rgb;
  frame.stamp = record.stamp;
  frame.bgr = decode(record.rgb, cv::IMREAD_COLOR);
  const cv::Mat raw = decode(record.depth, cv::IMREAD_UNCHANGED);
  if (raw.type() != CV_16UC1)
    throw InputError(record.depth.string(), 0, "is not a 16-bit image of one channel");
  cv::cvtColor(frame.bgr, frame.gray, cv::COLOR_BGR2GRAY);
  frame.depth = depth_in_metres(raw, camera);
  return frame;
}

FrameStream::FrameStream(const Sequence& sequence, const CameraConfig& camera, const StreamOptions& options)
    : frames_(sequence.frames),
      camera_(checked(camera)),
      options_(options),
      queue_(options.queue),
      thread_([this](const std::stop_token& stop) { decode(stop); }) {}

void FrameStream::decode(const std::stop_token& stop) {
  step_back(StepBack::some);
  for (std::size_t i = 0; i < frames_.size() && !stop.stop_requested(); ++i) {
    FrameResult result;
    result.index = i;
    result.record = frames_[i];
    try {
      result.frame = decode_frame(frames_[i], i, camera_);
      if (options_.prepare) options_.prepare(*result.frame);
    } catch (const std::bad_alloc&) {
      result.error = frames_[i].rgb.string() + ": there is not enough memory to decode it";
      result.frame.reset();
    } catch (const std::exception& error) {  // a broken frame is the reader's to judge, not the thread's
      result.error = error.what();
      result.frame.reset();
    }
    if (!queue_.push(std::move(result), stop)) return;
  }
  queue_.close();
}

std::optional<FrameResult> FrameStream::next() {
  return queue_.pop();
}

}  // namespace dynslam::runtime
