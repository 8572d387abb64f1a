// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/io/frame_pipe.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <sstream>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "io/binary_file.hpp"

namespace dynslam::runtime {
namespace {

constexpr const char *kFramesLine = "dynslam-frames 1", *kMasksLine = "dynslam-masks 1";
constexpr std::array<char, 4> kFrameMark{'F', 'R', 'M', 'E'}, kMaskMark{'M', 'A', 'S', 'K'};

enum class PipedColour : std::uint8_t { bgr, rgb, grey, file };
enum class PipedDepth : std::uint8_t { uint16, float32, file };

/// The header of a frame, in this order without gaps.
struct FrameHead {
  std::array<char, 4> mark;
  std::int64_t ns;
  std::uint8_t colour, depth;
  std::uint16_t zero;
  std::uint32_t colour_bytes, depth_bytes;
};
constexpr std::size_t kFrameHeadBytes = 24;

/// A line, without its end; nullopt where it does not end within `longest`.
std::optional<std::string> read_line(std::istream& in, std::size_t longest) {
  std::string line;
  for (int c = in.get(); c != '\n'; c = in.get()) {
    if (c == std::istream::traits_type::eof() || line.size() == longest) return std::nullopt;
    line += static_cast<char>(c);
  }
  return line;
}

constexpr const char* kCarriageReturn = "lines end in \\r\\n: the two before the frames end in \\n alone";

/// "fx=500 fy = 500 ...", the keys of a camera file, or what load_camera() takes.
CameraConfig camera_of_line(const std::string& line, const std::string& name) {
  if (line.find('=') == std::string::npos) {
    if (line.ends_with('\r')) throw InputError(name, 0, kCarriageReturn);
    try {
      return load_camera(line);
    } catch (const UsageError& error) {
      throw InputError(name + ", camera", 0, error.what());
    }
  }
  std::string lines;
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (line[i] != ' ' && line[i] != '\t') {
      lines += line[i];
      continue;
    }
    const std::size_t next = std::min(line.find_first_not_of(" \t", i), line.size());
    const bool about_equals = (next < line.size() && line[next] == '=') || (i > 0 && line[i - 1] == '=');
    lines += about_equals ? ' ' : '\n';
    i = next - 1;
  }
  std::istringstream in(lines);
  return parse_camera(in, name + ", camera");
}

}  // namespace

FramePipe::FramePipe(std::istream& in, std::string name) : in_(in), name_(std::move(name)) {
  const auto first = read_line(in_, 100);
  if (first != kFramesLine) {
    const bool other = first && first->starts_with("dynslam-frames ");
    if (other && first->ends_with('\r')) throw InputError(name_, 0, kCarriageReturn);
    throw InputError(
        name_, 0,
        other ? fmt::format("is a stream of version {}, this program reads version 1", first->substr(15))
              : fmt::format("does not begin with the line '{}'", kFramesLine));
  }
  const auto camera = read_line(in_, 10000);
  if (!camera) throw InputError(name_, 0, "has no line with the camera");
  camera_ = camera_of_line(*camera, name_);
}

void FramePipe::fail(const std::string& reason) const {
  throw InputError(name_, 0, fmt::format("frame {}: {}", frames_ + 1, reason));
}

void FramePipe::read(char* to, std::size_t bytes, const char* what) {
  in_.read(to, static_cast<std::streamsize>(bytes));
  const auto got = static_cast<std::size_t>(in_.gcount());
  if (got < bytes) fail(fmt::format("ends within the {}, after {} of {} bytes", what, got, bytes));
}

cv::Mat FramePipe::read_raw(int type, std::uint32_t bytes, const char* what) {
  cv::Mat image(camera_.height, camera_.width, type);
  const std::size_t expected = image.total() * image.elemSize();
  if (bytes != expected)
    fail(fmt::format("the {} has {} bytes, one of {}x{} has {}", what, bytes, camera_.width, camera_.height,
                     expected));
  read(image.ptr<char>(), bytes, what);
  return image;
}

cv::Mat FramePipe::read_encoded(int flags, std::uint32_t bytes, const char* what) {
  // No file of an image is much larger than its pixels of 8 bytes.
  const double most = 8.0 * camera_.width * camera_.height + (1 << 20);
  if (bytes > most) fail(fmt::format("the {} has {} bytes, more than any image", what, bytes));
  std::string content(bytes, '\0');
  read(content.data(), bytes, what);
  const EncodedImage encoded(fmt::format("{}: frame {}: {}", name_, frames_ + 1, what), std::move(content));
  if (encoded.size() != cv::Size(camera_.width, camera_.height))
    fail(fmt::format("the {} is {}x{}, the camera's images are {}x{}", what, encoded.size().width,
                     encoded.size().height, camera_.width, camera_.height));
  return encoded.decode(flags);
}

std::optional<PipedFrame> FramePipe::next() {
  if (in_.peek() == std::istream::traits_type::eof()) return std::nullopt;
  std::array<char, kFrameHeadBytes> bytes;
  read(bytes.data(), bytes.size(), "frame's head");
  std::size_t at = 0;
  const auto take = [&](auto& value) {
    std::memcpy(&value, bytes.data() + at, sizeof value);
    at += sizeof value;
  };
  FrameHead head;
  take(head.mark), take(head.ns), take(head.colour), take(head.depth), take(head.zero);
  take(head.colour_bytes), take(head.depth_bytes);
  if (head.mark != kFrameMark)
    fail("does not begin with FRME: the frame before had other bytes than it said");
  if (head.zero != 0) fail(fmt::format("bytes 14 and 15 are {}, not 0", head.zero));

  PipedFrame frame;
  frame.ns = head.ns;
  switch (static_cast<PipedColour>(head.colour)) {
    case PipedColour::bgr:
      frame.image = read_raw(CV_8UC3, head.colour_bytes, "colour image");
      break;
    case PipedColour::rgb:
      frame.image = read_raw(CV_8UC3, head.colour_bytes, "colour image");
      cv::cvtColor(frame.image, frame.image, cv::COLOR_RGB2BGR);
      break;
    case PipedColour::grey:
      frame.image = read_raw(CV_8UC1, head.colour_bytes, "colour image");
      break;
    case PipedColour::file:
      frame.image = read_encoded(cv::IMREAD_COLOR, head.colour_bytes, "colour image");
      break;
    default:
      fail(fmt::format("colour code {} is none of 0 to 3", head.colour));
  }
  switch (static_cast<PipedDepth>(head.depth)) {
    case PipedDepth::uint16:
      frame.depth = read_raw(CV_16UC1, head.depth_bytes, "depth image");
      break;
    case PipedDepth::float32:
      frame.depth = read_raw(CV_32FC1, head.depth_bytes, "depth image");
      break;
    case PipedDepth::file:
      frame.depth = read_encoded(cv::IMREAD_UNCHANGED, head.depth_bytes, "depth image");
      if (frame.depth.type() != CV_16UC1) fail("the depth image is no PNG of one channel of 16 bits");
      break;
    default:
      fail(fmt::format("depth code {} is none of 0 to 2", head.depth));
  }
  ++frames_;
  return frame;
}

MaskPipe::MaskPipe(std::FILE* out) : out_(out) {
  write(fmt::format("{}\n", kMasksLine));
}

void MaskPipe::put(std::int64_t ns, bool tracked, const cv::Mat& mask) {
  BinaryWriter bytes;
  bytes.put_bytes({kMaskMark.data(), kMaskMark.size()});
  bytes.put(ns);
  bytes.put(static_cast<std::uint32_t>(tracked ? 1 : 0));
  bytes.put(static_cast<std::uint32_t>(mask.total()));
  for (int v = 0; v < mask.rows; ++v)
    bytes.put_bytes({mask.ptr<char>(v), static_cast<std::size_t>(mask.cols)});
  write(bytes.bytes());
}

void MaskPipe::write(std::string_view bytes) {
  if (std::fwrite(bytes.data(), 1, bytes.size(), out_) != bytes.size() || std::fflush(out_) != 0)
    throw InputError("standard output", 0, "cannot be written");
}

}  // namespace dynslam::runtime
