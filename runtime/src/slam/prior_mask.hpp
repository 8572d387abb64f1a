// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "dynslam/dynamics/mask_arbitration.hpp"
#include "dynslam/dynamics/standing.hpp"
#include "dynslam/runtime/masks.hpp"
#include "slam/frame_state.hpp"

namespace dynslam::runtime {

/// Options of PriorMask.
struct PriorMaskOptions {
  bool use = true;        ///< the mode takes a-priori masks
  int margin = 9;         ///< pixels added around them
  double min_left = 0.2;  ///< share of the features that a mask has to leave, or it covers the view
};

/// The a-priori masks, of a network or of files: which features they take out, and what of them is static.
class PriorMask {
 public:
  explicit PriorMask(const PriorMaskOptions& options) : options_(options) {}

  /// Flags a frame's features on the mask, but for those on surfaces that were static in the frame before,
  /// and sets its dynamic mask.
  void apply(const std::optional<Masks>& prior, FrameState& now) const;
  /// Goes on without the mask, as far as the pose is concerned. @return whether there was one
  static bool reject(MaskVerdict why, FrameState& now);

  /// Finds surfaces that are static: where they were long before. They are used for the pose whatever a mask
  /// says of them. In the mask that is output they stay, with the rest of their objects, as something that
  /// may move. The pose does not use that rest: a board that comes into view in front of it has no evidence
  /// yet, either.
  template <class Verified>
  void mark_static(Verified&& verified, FrameState& now) {
    constexpr int kStride = 4;  // [px]
    static_.create(now.result.dynamic_mask.size(), CV_8UC1);
    static_.setTo(0);
    mark_standing(interop::view<const std::uint8_t>(std::as_const(now.moving_widened)), verified, kStride,
                  interop::view<std::uint8_t>(static_));
    static_.copyTo(whole_);
    if (!now.prior->instances.empty()) {
      mark_standing_objects(interop::view<const std::uint16_t>(now.prior->instances), now.depth,
                            interop::view<const std::uint8_t>(std::as_const(now.moving)),
                            interop::view<std::uint8_t>(whole_), counts_);
    }
    now.result.dynamic_mask.setTo(kMayMove, whole_ & now.result.dynamic_mask);
  }
  /// 255 on those surfaces; empty: none are known.
  [[nodiscard]] const cv::Mat& static_surfaces() const { return static_; }
  /// They are known only as long as the camera's place is.
  void forget_static() { static_.release(); }

 private:
  PriorMaskOptions options_;
  cv::Mat static_, whole_;  // CV_8UC1; whole: with the rest of their objects
  std::vector<StandingCount> counts_;
};

}  // namespace dynslam::runtime
