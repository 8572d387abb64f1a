// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>

#include "dynslam/runtime/frame.hpp"
#include "dynslam/runtime/nets/mask_keeper.hpp"
#include "dynslam/runtime/nets/onnx_segmenter.hpp"

namespace dynslam::runtime {

class MaskCache;

/// Options of FrameSegmenter.
struct FrameSegmenterOptions {
  SegmenterOptions segmenter;
  MaskKeeperOptions keeper;
  int every = 1;                ///< the network sees every so many frames; between them masks are carried
  double period = 0.1;          ///< seconds from one frame that it sees to the next where `every` is 0
  bool keep = true;             ///< refine by depth and carry what the network misses
  std::filesystem::path cache;  ///< folder that keeps the network's masks between runs; empty: none
};

/// The masks of a frame, and what they cost.
struct FrameMasks {
  std::optional<Masks> masks;
  double network_ms = 0, keeper_ms = 0;
};

/// What later frames may take from this one's labels; null where nothing that stands still has one.
[[nodiscard]] std::shared_ptr<const EarlierLabels> labels_for_later(const Masks& masks,
                                                                    const RgbdFrame& frame);

/// The masks of one frame after the other: a network's, refined and carried.
class FrameSegmenter {
 public:
  /// @throws what OnnxSegmenter throws; UsageError; InputError: the cache cannot be used
  explicit FrameSegmenter(const FrameSegmenterOptions& options);
  ~FrameSegmenter();

  /// @param index  of the frame in the sequence: which frames the network sees
  /// @throws what the network meets
  [[nodiscard]] FrameMasks segment(const RgbdFrame& frame, std::size_t index);
  /// Forgets the frames before, as at the start of another sequence.
  void reset();

  [[nodiscard]] const OnnxSegmenter& segmenter() const { return segmenter_; }

 private:
  /// Whether the network sees a frame.
  [[nodiscard]] bool due(const RgbdFrame& frame, std::size_t index) const;

  FrameSegmenterOptions options_;
  OnnxSegmenter segmenter_;
  MaskKeeper keeper_;
  std::optional<double> asked_;                // time of the last frame that the network saw [s]
  std::shared_ptr<const EarlierLabels> seen_;  // of the last frame that the network saw
  std::unique_ptr<MaskCache> cache_;
};

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
