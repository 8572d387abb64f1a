// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/io/sequence.hpp"
#include "dynslam/runtime/threads/bounded_queue.hpp"

namespace dynslam::runtime {

struct ImageFeatures;  // of slam/feature_extractor.hpp; reading knows nothing of it

/// A frame in memory, ready for tracking.
struct RgbdFrame {
  std::size_t index = 0;   ///< in the sequence, broken frames counted; the tracker counts for itself
  double t = 0;            ///< colour time [s]
  std::int64_t ns = 0;     ///< the same in nanoseconds, as it was recorded; 0: unknown
  double depth_delay = 0;  ///< depth time less colour time [s]
  std::string stamp;
  cv::Mat bgr;    ///< CV_8UC3
  cv::Mat gray;   ///< CV_8UC1
  cv::Mat depth;  ///< CV_32FC1 metres, NaN = invalid
  // What FramePreparation adds; empty where it was not asked.
  std::shared_ptr<const ImageFeatures> features;
  double preparation_ms = 0;
};

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
