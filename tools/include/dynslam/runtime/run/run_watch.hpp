// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <functional>
#include <opencv2/core.hpp>

#include "dynslam/runtime/frame.hpp"
#include "dynslam/runtime/slam.hpp"
#include "dynslam/runtime/slam/track_result.hpp"

namespace dynslam::runtime {

/// A frame of a run that was tracked just now. Valid during the call it is handed to; images that are kept
/// must not be changed.
struct WatchedFrame {
  std::size_t number = 0;  ///< in the sequence, from 1
  std::size_t total = 0;   ///< frames of the sequence
  const RgbdFrame& frame;
  const TrackResult& result;
  const cv::Mat& semantic;  ///< the a-priori mask, CV_8UC1; empty: none
  const Slam& slam;         ///< the system that tracked it; may be looked at
};

/// Functions that look at a run while it goes on. They change nothing of its results: a run that is watched
/// writes the same trajectories, masks and maps. What they throw ends the run.
struct RunWatch {
  /// Called with each frame on the thread that tracks, which goes on when it returns; its time is no frame's.
  std::function<void(const WatchedFrame&)> frame{};
  SemanticMapper::MapCallback mapped{};  ///< see SlamOptions
};

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
