// SPDX-License-Identifier: BSD-3-Clause
#include "slam/prior_mask.hpp"

#include <algorithm>

namespace dynslam::runtime {

void PriorMask::apply(const std::optional<Masks>& prior, FrameState& now) const {
  if (!options_.use || !prior || prior->dynamic.empty()) {
    now.result.dynamic_mask = cv::Mat::zeros(now.input.gray.size(), CV_8UC1);
    return;
  }
  Frame& frame = now.frame();
  now.prior = &*prior;
  now.semantic = widened(prior->dynamic, options_.margin);
  if (!static_.empty()) now.semantic.setTo(0, static_);  // of the frame before: people hardly jump in one
  flag(frame, now.semantic, frame.dynamic);
  // The margin keeps features off an object's rim; the mask that is output is the object itself.
  cv::compare(prior->dynamic, 0, now.result.dynamic_mask, cv::CMP_NE);
  now.mask_covers_view = unmasked_share<double>(frame.dynamic) < options_.min_left;
}

bool PriorMask::reject(MaskVerdict why, FrameState& now) {
  if (now.semantic.empty()) return false;
  now.semantic.release();
  std::fill(now.frame().dynamic.begin(), now.frame().dynamic.end(), std::uint8_t(0));
  now.result.mask_rejected = why;
  return true;
}

}  // namespace dynslam::runtime
