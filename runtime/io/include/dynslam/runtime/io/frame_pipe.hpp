// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <istream>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "dynslam/runtime/io/camera.hpp"

namespace dynslam::runtime {

/// A frame of a FramePipe.
struct PipedFrame {
  std::int64_t ns = 0;  ///< time of the colour image [ns]
  cv::Mat image;        ///< CV_8UC3 (BGR) or CV_8UC1
  cv::Mat depth;        ///< CV_16UC1 in the camera's units, or CV_32FC1 in metres
};

/// Frames that another program writes, as `dynslam masks -` reads them: a line "dynslam-frames 1", a line
/// with the camera, then frames. The bytes are those of docs/mask-stream.md.
class FramePipe {
 public:
  /// Reads the two lines.
  /// @param in    must outlive this
  /// @param name  for messages: "standard input"
  /// @throws InputError for another beginning or version, what load_camera() and parse_camera() throw
  FramePipe(std::istream& in, std::string name);

  [[nodiscard]] const CameraConfig& camera() const { return camera_; }
  /// The next frame; nullopt where the stream ends behind one.
  /// @throws InputError with the frame's number (from 1) and the reason: cut off, no frame, an encoding that
  /// is none,
  ///         images that are damaged or of another size than the camera's
  [[nodiscard]] std::optional<PipedFrame> next();
  /// Frames read so far.
  [[nodiscard]] std::size_t frames() const { return frames_; }

 private:
  [[nodiscard]] cv::Mat read_raw(int type, std::uint32_t bytes, const char* what);
  [[nodiscard]] cv::Mat read_encoded(int flags, std::uint32_t bytes, const char* what);
  void read(char* to, std::size_t bytes, const char* what);
  [[noreturn]] void fail(const std::string& reason) const;

  std::istream& in_;
  std::string name_;
  CameraConfig camera_;
  std::size_t frames_ = 0;
};

/// Writes masks as `dynslam masks -` does, a line "dynslam-masks 1" first.
class MaskPipe {
 public:
  /// @param out  stays the caller's and open
  explicit MaskPipe(std::FILE* out);
  /// Writes a mask and flushes it. @param tracked  whether the frame has a pose; @param mask  CV_8UC1, 255 =
  /// dynamic
  /// @throws InputError where it cannot be written
  void put(std::int64_t ns, bool tracked, const cv::Mat& mask);

 private:
  void write(std::string_view bytes);
  std::FILE* out_;
};

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
