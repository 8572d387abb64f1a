// SPDX-License-Identifier: BSD-3-Clause
#include "slam/background_check.hpp"

#include <cstdint>
#include <utility>
#include <vector>

namespace dynslam::runtime {
namespace {

/// Whether more than a share of the matches lies on a mask.
bool rests_on(const Frame& frame, const cv::Mat& mask, double share) {
  std::vector<std::uint8_t> on_mask;
  flag(frame, mask, on_mask);
  std::ptrdiff_t matches = 0, on_it = 0;
  for (std::size_t i = 0; i < on_mask.size(); ++i) {
    if (frame.point[i] < 0) continue;
    ++matches;
    on_it += on_mask[i] != 0 ? 1 : 0;
  }
  return static_cast<double>(on_it) > share * static_cast<double>(matches);
}

}  // namespace

void BackgroundCheck::check(std::size_t age, bool strict, LocalMap& map, const LastFrame<double>& last,
                            LastImages& images, MotionDetection& motion, PoseSolver& solver,
                            FrameState& now) const {
  if (!images.can_align() || last.lost_frames() > 0 || age > options_.young_frames) return;
  Frame& frame = now.frame();
  cv::Mat foreground = cv::Mat::zeros(now.input.gray.size(), CV_8UC1);
  if (!motion.segmenter().mark_foreground(now.depth, interop::view<std::uint8_t>(foreground)) ||
      !rests_on(frame, foreground, options_.foreground_share))
    return;
  const SE3<double>& T_last_w = last.frame().T_c_w;
  const auto behind = images.view().align_behind(now.image->pyramid, now.depth, foreground, camera_,
                                                 frame.T_c_w * T_last_w.inverse());
  if (!behind.ok()) return;
  const PoseSolver::Attempt before = solver.save(now.pose);
  solver.matcher().clear(frame);
  std::vector<std::uint8_t> flags = frame.dynamic;
  cv::Mat left_out = widened(foreground, margin_);
  if (!now.covering_mask().empty()) left_out |= now.covering_mask();
  frame.T_c_w = behind.T_image_reference * T_last_w;
  const Evidence from = now.evidence(map, last, left_out);
  const bool proven = solver.prove(from, options_.min_inliers, strict, now.pose);
  solver.optimiser().gather(map, frame);
  const double outlier = options_.local_chi2;
  // Most of what lies behind is not where the pose before has it.
  if (proven && solver.optimiser().mean_chi2(before.estimate.frame.T_c_w, outlier) > outlier / 2) {
    flags.resize(frame.features.size(), 0);
    for (std::size_t i = 0; i < flags.size(); ++i) {
      if (frame.dynamic[i] != flags[i]) frame.point[i] = -1;
    }
    frame.dynamic = std::move(flags);
    now.foreground = foreground;
    return;
  }
  solver.restore(from, before, now.pose);
}

}  // namespace dynslam::runtime
