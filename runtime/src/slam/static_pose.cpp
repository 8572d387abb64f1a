// SPDX-License-Identifier: BSD-3-Clause
#include "slam/static_pose.hpp"

#include <cmath>
#include <cstddef>
#include <utility>

namespace dynslam::runtime {

void StaticPose::optimise(const Evidence& from, const cv::Mat& static_surfaces, const MotionDetection& motion,
                          PoseSolver& solver, FrameState& now) {
  Frame& frame = now.frame();
  // A feature is a patch: at the rim of what moves half of it moves.
  masks_.resize(now.semantic.empty() ? 1 : 2);
  for (auto& mask : masks_) {
    mask.assign(frame.features.size(), 0);
    flag(frame, now.moving_widened, mask);
  }
  if (!now.semantic.empty()) {
    cv::Mat suspected = widened(now.result.dynamic_mask, options_.margin);
    if (!static_surfaces.empty()) suspected.setTo(0, static_surfaces);
    flag(frame, suspected, masks_[0]);
    for (std::size_t i = 0; i < frame.dynamic.size(); ++i) masks_[0][i] |= frame.dynamic[i];
  }
  solver.estimate_readout_rotation(from.last, from.time.t, now.pose.turn);
  const auto fused = masked_pose(
      solver.optimiser(), from.map, frame.T_c_w, masks_, options_.arbitration, frame,
      [&](int point) { ++from.map.point(point).on_mover; }, workspace_);
  if (fused.verdict != MaskVerdict::kept) now.result.mask_rejected = fused.verdict;
  if (fused.pose.inliers >= options_.min_inliers) {
    now.pose.take(fused.pose);
    solver.apply_readout_rotation(from, fused.pose.turn, now.pose);
  }
  // That matches on a mask are used for the pose does not mean that what it shows is static.
  cv::bitwise_or(now.result.dynamic_mask, now.moving, now.result.dynamic_mask);
  if (fused.mask < masks_.size()) return;
  for (std::size_t i = 0; i < frame.dynamic.size(); ++i) {  // without evidence for it nothing makes points
    const Feature& f = frame.features[i];
    frame.dynamic[i] = masks_[0][i] != 0 && frame.point[i] < 0 && !motion.verified_static(f.u, f.v) ? 1 : 0;
  }
}

}  // namespace dynslam::runtime
