// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include "dynslam/runtime/frame.hpp"
#include "dynslam/runtime/slam/feature_extractor.hpp"
#include "dynslam/runtime/slam/tracker.hpp"

namespace dynslam::runtime {

/// The part of a frame's work that needs no pose: features and the image pyramid. It is done ahead, on the
/// thread that decodes the images; the tracker does itself what was not done.
class FramePreparation {
 public:
  explicit FramePreparation(const TrackerOptions& options) : extractor_(options.features) {}

  void operator()(RgbdFrame& frame);

 private:
  FeatureExtractor extractor_;
};

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
