// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/frame_preparation.hpp"

#include <memory>

#include "dynslam/runtime/stopwatch.hpp"

namespace dynslam::runtime {

void FramePreparation::operator()(RgbdFrame& frame) {
  Stopwatch watch;
  auto features = std::make_shared<ImageFeatures>();
  extractor_.extract(frame.gray, *features);
  frame.features = std::move(features);
  frame.preparation_ms = watch.lap_ms();
}

}  // namespace dynslam::runtime
