// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "dynslam/runtime/nets/frame_segmenter.hpp"

namespace dynslam::runtime {

/// Masks for frames that do not wait for the network. It sees the newest frame whenever it is free; what it
/// found there is carried through the frames that came meanwhile, and on to every frame until it has seen
/// another one.
class LateMasks {
 public:
  /// @param longest_age  time that masks are carried at most [s]
  /// @throws what FrameSegmenter throws; UsageError where masks are not to be carried (`keep`)
  LateMasks(const FrameSegmenterOptions& options, double longest_age);

  struct Carried {
    std::optional<Masks> masks;  ///< nullopt: none yet, or too old
    double age = 0;              ///< time since the frame that the network saw [s]
    double network_ms = 0;       ///< of what came with this frame; 0: nothing new
    double keeper_ms = 0;
  };
  /// Masks of the next frame. Its images must not change afterwards. @throws what the network met
  [[nodiscard]] Carried next(const RgbdFrame& frame);

  /// Frames that the network saw, and whose masks were used.
  [[nodiscard]] std::size_t seen() const;
  /// Whether the network is at work.
  [[nodiscard]] bool busy() const;

 private:
  struct Image {  // what carrying needs of a frame
    cv::Mat gray, depth;
    double t = 0;
  };
  struct Found {
    MaskKeeper keeper;  // at the newest frame but a few
    double t = 0;       // of the frame that the network saw
    std::shared_ptr<const EarlierLabels> labels;
    double network_ms = 0;
  };

  void work(const std::stop_token& stop);
  void offer(const RgbdFrame& frame);
  /// Carries what was found through the frames that came since, but for the last.
  void catch_up(Found& found);

  FrameSegmenterOptions options_;
  double longest_age_;
  FrameSegmenter network_;
  MaskKeeper keeper_;             // at the frame before
  std::optional<double> seen_t_;  // of the frame that its masks were found in
  std::shared_ptr<const EarlierLabels> seen_labels_;
  std::size_t frames_ = 0;

  mutable std::mutex mutex_;
  std::condition_variable_any changed_;
  std::optional<RgbdFrame> job_;
  MaskKeeper before_job_;
  bool busy_ = false;
  std::deque<Image> since_;  // frames after the one that the network sees
  std::optional<Found> found_;
  std::size_t seen_ = 0;
  std::exception_ptr failure_;
  std::jthread thread_;  // last: it uses all of the above
};

}  // namespace dynslam::runtime
