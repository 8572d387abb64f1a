// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <thread>

#include "dynslam/runtime/io/tum_reader.hpp"
#include "dynslam/runtime/nets/mask_keeper.hpp"
#include "dynslam/runtime/nets/onnx_segmenter.hpp"
#include "dynslam/runtime/threads/bounded_queue.hpp"

namespace dynslam::runtime {

struct SegmentationStageOptions {
  SegmenterOptions segmenter;
  MaskKeeperOptions keeper;
  int every = 1;                ///< the network sees every so many frames; between them masks are carried
  bool async = true;            ///< on a thread of its own, ahead of the tracker
  bool keep = true;             ///< refine by depth and carry what the network misses
  std::size_t queue = 2;        ///< frames segmented ahead
  std::filesystem::path cache;  ///< folder that keeps the network's masks between runs; empty: none
};

/// A frame with its masks.
struct SegmentedFrame {
  FrameResult frame;
  std::optional<Masks> masks;
  double network_ms = 0, keeper_ms = 0;
};

/// The paper's first stage, off the critical path: frames pass from the reader through the network to
/// the tracker. Each frame gets the masks of that very frame whether the stage runs on its own thread
/// or not, so both give the same results in every run; its own thread costs a delay, not the tracker's time.
class SegmentationStage {
 public:
  /// @param frames  must outlive the stage and is read by it alone
  /// @throws what OnnxSegmenter throws
  SegmentationStage(FrameStream& frames, const SegmentationStageOptions& options);

  /// Next frame, broken ones included (without masks); nullopt at the end.
  /// @throws what the network met at that frame
  std::optional<SegmentedFrame> next();

  [[nodiscard]] const OnnxSegmenter& segmenter() const { return segmenter_; }

 private:
  [[nodiscard]] std::optional<SegmentedFrame> process();
  [[nodiscard]] Masks network_masks(const RgbdFrame& frame);
  void work(const std::stop_token& stop);

  FrameStream& frames_;
  SegmentationStageOptions options_;
  OnnxSegmenter segmenter_;
  MaskKeeper keeper_;
  std::string cache_key_;
  BoundedQueue<SegmentedFrame> queue_;
  std::jthread thread_;  // last: it uses all of the above
};

}  // namespace dynslam::runtime
