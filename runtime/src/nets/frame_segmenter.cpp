// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/nets/frame_segmenter.hpp"

#include <utility>

#include "dynslam/runtime/stopwatch.hpp"
#include "io/argument_check.hpp"
#include "nets/mask_cache.hpp"

namespace dynslam::runtime {

std::shared_ptr<const EarlierLabels> labels_for_later(const Masks& masks, const RgbdFrame& frame) {
  if (masks.labels.empty() || cv::countNonZero(masks.labels > static_cast<int>(Label::person)) == 0)
    return {};
  return std::make_shared<const EarlierLabels>(EarlierLabels{frame.t, frame.depth, masks.labels});
}

FrameSegmenter::FrameSegmenter(const FrameSegmenterOptions& options)
    : options_(options), segmenter_(options.segmenter), keeper_(options.keeper) {
  check_argument(options_.every >= 0, "FrameSegmenter: `every` must be 0 or more");
  check_argument(options_.period > 0, "FrameSegmenter: `period` must be above 0");
  if (!options_.cache.empty())
    cache_ = std::make_unique<MaskCache>(options_.cache, segmenter_, options_.segmenter);
}

FrameSegmenter::~FrameSegmenter() = default;

bool FrameSegmenter::due(const RgbdFrame& frame, std::size_t index) const {
  if (options_.every > 0) return index % static_cast<std::size_t>(options_.every) == 0;
  constexpr double kPunctual = 0.9;  // of a period: cameras' intervals vary
  return !asked_ || frame.t - *asked_ >= kPunctual * options_.period;
}

FrameMasks FrameSegmenter::segment(const RgbdFrame& frame, std::size_t index) {
  FrameMasks out;
  Stopwatch watch;
  const bool sees = due(frame, index);
  if (sees) asked_ = frame.t;
  if (sees) out.masks = cache_ ? cache_->masks_of(frame.bgr, segmenter_) : segmenter_.segment(frame.bgr);
  out.network_ms = watch.lap_ms();
  if (options_.keep) {
    out.masks = keeper_.update(out.masks, frame.gray, frame.depth, frame.t);
    if (sees && options_.every != 1) {
      seen_ = labels_for_later(*out.masks, frame);
    } else {
      out.masks->earlier = seen_;
    }
    out.keeper_ms = watch.lap_ms();
  }
  return out;
}

void FrameSegmenter::reset() {
  keeper_ = MaskKeeper(options_.keeper);
  seen_.reset();
  asked_.reset();
}

}  // namespace dynslam::runtime
