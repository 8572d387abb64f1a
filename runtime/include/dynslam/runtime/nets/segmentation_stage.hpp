// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <optional>
#include <thread>

#include "dynslam/runtime/io/frame_stream.hpp"
#include "dynslam/runtime/nets/frame_segmenter.hpp"
#include "dynslam/runtime/threads/bounded_queue.hpp"

namespace dynslam::runtime {

/// Options of SegmentationStage.
struct SegmentationStageOptions : FrameSegmenterOptions {
  bool async = true;      ///< on a thread of its own, ahead of the tracker
  std::size_t queue = 2;  ///< frames segmented ahead
};

/// A frame with its masks.
struct SegmentedFrame {
  FrameResult frame;
  FrameMasks segmented;
};

/// The paper's first stage, off the critical path: frames pass from the reader through the network to
/// the tracker. Each frame gets the masks of that very frame whether the stage runs on its own thread
/// or not, so both give the same results in every run; its own thread costs a delay, not the tracker's time.
class SegmentationStage {
 public:
  /// @param frames  must outlive the stage and is read by it alone
  /// @throws what FrameSegmenter throws
  SegmentationStage(FrameStream& frames, const SegmentationStageOptions& options);

  /// Next frame, broken ones included (without masks); nullopt at the end.
  /// @throws what the network met at that frame
  std::optional<SegmentedFrame> next();

  [[nodiscard]] const OnnxSegmenter& segmenter() const { return segmenter_.segmenter(); }
  /// OnnxSegmenter::describe(), when the frames have ended: the stage's thread is ended first.
  [[nodiscard]] std::string describe();

 private:
  [[nodiscard]] std::optional<SegmentedFrame> process();
  void work(const std::stop_token& stop);

  FrameStream& frames_;
  bool async_;
  FrameSegmenter segmenter_;
  BoundedQueue<SegmentedFrame> queue_;
  std::jthread thread_;  // last: it uses all of the above
};

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
