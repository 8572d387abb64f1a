// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/io/frame_stream.hpp"

#include <fmt/format.h>

#include <exception>
#include <new>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "io/argument_check.hpp"
#include "io/frame_images.hpp"
#include "io/frame_of_images.hpp"
#include "threads/thread_priority.hpp"

namespace dynslam::runtime {
RgbdFrame decode_frame(const FrameRecord& record, std::size_t index, const CameraConfig& camera) {
  (void)checked(camera);
  const cv::Size camera_size(camera.width, camera.height);
  RgbdFrame frame;
  frame.index = index;
  frame.t = record.t_rgb;
  frame.ns = record.ns;
  frame.depth_delay = record.t_depth - record.t_rgb;
  frame.stamp = record.stamp;
  if (record.colour_size.empty()) {
    frame.bgr = read_image(record, ImageSource::Kind::colour, camera_size);
  } else {
    cv::resize(read_image(record, ImageSource::Kind::colour, record.colour_size), frame.bgr, camera_size, 0,
               0, cv::INTER_AREA);
  }
  const cv::Mat raw = read_image(record, ImageSource::Kind::depth, camera_size);
  const bool floats = raw.type() == CV_32FC1;
  if (!floats && raw.type() != CV_16UC1)
    throw InputError(record.depth.string(), 0,
                     fmt::format("is not a 16-bit image of one channel, as depth is, but has {} bits and {} "
                                 "channel{}",
                                 8 * raw.elemSize1(), raw.channels(), raw.channels() == 1 ? "" : "s"));
  cv::cvtColor(frame.bgr, frame.gray, cv::COLOR_BGR2GRAY);
  if (!floats) {
    frame.depth = depth_in_metres(raw, camera);
  } else if (record.float_units) {
    raw.convertTo(frame.depth, CV_32FC1, 1 / camera.depth_units_per_metre);
  } else {
    frame.depth = raw;
  }
  return frame;
}

void check_readable(const std::string& sequence, std::size_t frames, std::span<const std::string> broken) {
  if (frames == 0) throw InputError(sequence, 0, "has no frames");
  if (2 * broken.size() > frames)
    throw InputError(sequence, 0,
                     fmt::format("{} of {} frames cannot be read; the first one: {}", broken.size(), frames,
                                 broken.front()));
}

namespace {

/// Does `step` with a frame; a broken frame is the reader's to judge, not the thread's.
template <class Step>
void attempt(FrameResult& result, const Step& step) {
  try {
    step();
  } catch (const std::bad_alloc&) {
    result.error = result.record.rgb.string() + ": there is not enough memory to decode it";
    result.frame.reset();
  } catch (const std::exception& error) {
    result.error = error.what();
    result.frame.reset();
  }
}

constexpr std::size_t kDecodedAhead = 2;  // of the thread that prepares: it is the slower one

}  // namespace

FrameStream::FrameStream(const Sequence& sequence, const CameraConfig& camera, const StreamOptions& options)
    : frames_(sequence.frames),
      camera_(checked(camera)),
      options_(options),
      decoded_(options.prepare ? kDecodedAhead : options.queue),
      ready_(options.queue),
      decoding_([this](const std::stop_token& stop) { decode(stop); }) {
  if (options_.prepare) preparing_ = std::jthread([this](const std::stop_token& stop) { prepare(stop); });
}

void FrameStream::decode(const std::stop_token& stop) {
  step_back(StepBack::some);
  for (std::size_t i = 0; i < frames_.size() && !stop.stop_requested(); ++i) {
    FrameResult result;
    result.index = i;
    result.record = frames_[i];
    attempt(result, [&] { result.frame = decode_frame(frames_[i], i, camera_); });
    if (!decoded_.push(std::move(result), stop)) return;
  }
  decoded_.close();
}

void FrameStream::prepare(const std::stop_token& stop) {
  step_back(StepBack::some);
  while (auto result = decoded_.pop(stop)) {
    if (result->frame) attempt(*result, [&] { options_.prepare(*result->frame); });
    if (!ready_.push(std::move(*result), stop)) return;
  }
  ready_.close();
}

std::optional<FrameResult> FrameStream::next() {
  return (options_.prepare ? ready_ : decoded_).pop();
}

}  // namespace dynslam::runtime
