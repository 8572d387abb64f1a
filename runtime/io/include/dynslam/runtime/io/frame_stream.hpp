// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "dynslam/runtime/frame.hpp"
#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/io/sequence.hpp"
#include "dynslam/runtime/threads/bounded_queue.hpp"

namespace dynslam::runtime {

/// Decodes one frame. @throws InputError naming the file: missing, truncated, of wrong type or size
[[nodiscard]] RgbdFrame decode_frame(const FrameRecord& record, std::size_t index,
                                     const CameraConfig& camera);

/// Options of FrameStream.
struct StreamOptions {
  std::size_t queue = 4;  ///< frames ready ahead
  /// Called with each frame, in their order, on a thread of its own: while it works on one the next is
  /// decoded.
  std::function<void(RgbdFrame&)> prepare{};
};

/// A frame, or why there is none.
struct FrameResult {
  std::size_t index = 0;
  FrameRecord record;
  std::optional<RgbdFrame> frame;
  std::string error;  ///< one line where `frame` is empty
};

/// Refuses a sequence without frames, or of which more than half cannot be read.
/// @param broken  why, a line for each of those
/// @throws InputError  naming the sequence, and the first of the reasons
void check_readable(const std::string& sequence, std::size_t frames, std::span<const std::string> broken);

/// Frames of a sequence in order, decoded ahead on a thread of its own and, where asked, prepared on another.
class FrameStream {
 public:
  FrameStream(const Sequence& sequence, const CameraConfig& camera, const StreamOptions& options = {});
  /// Next frame, broken ones included; nullopt at the end.
  std::optional<FrameResult> next();

 private:
  void decode(const std::stop_token& stop);
  void prepare(const std::stop_token& stop);

  std::vector<FrameRecord> frames_;
  CameraConfig camera_;
  StreamOptions options_;
  BoundedQueue<FrameResult> decoded_, ready_;
  // Last: they use all of the above.
  std::jthread decoding_, preparing_;
};

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
