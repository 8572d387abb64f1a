// SPDX-License-Identifier: BSD-3-Clause
#include "slam/frame_poses.hpp"

#include <algorithm>

namespace dynslam::runtime {

void FramePoses::add(const RgbdFrame& frame, const TrackResult& result) {
  frames_.push_back({frame.t, frame.ns, result.reference, result.T_c_reference, result.keyframe});
}

void FramePoses::take(const FramePoses& other, int first_keyframe) {
  frames_.reserve(frames_.size() + other.frames_.size());
  for (FramePose frame : other.frames_) {
    frame.reference += first_keyframe;
    frames_.push_back(frame);
  }
  std::stable_sort(frames_.begin(), frames_.end(), [](const auto& a, const auto& b) { return a.t < b.t; });
}

SE3<double> FramePoses::T_w_c(const FramePose& frame, const LocalMap& map) {
  return (frame.T_c_reference * map.pose(frame.reference)).inverse();
}

std::optional<SE3<double>> FramePoses::pose_at(double t, const LocalMap& map) const {
  const auto it = std::lower_bound(frames_.begin(), frames_.end(), t,
                                   [](const FramePose& frame, double time) { return frame.t < time; });
  if (it == frames_.end() || it->t != t) return std::nullopt;
  return T_w_c(*it, map);
}

std::vector<StampedPose<double>> FramePoses::poses(const LocalMap& map, bool keyframes_alone) const {
  std::vector<StampedPose<double>> result;
  for (const FramePose& frame : frames_) {
    if (keyframes_alone && !frame.keyframe) continue;
    result.push_back({frame.t, T_w_c(frame, map), frame.ns});
  }
  return result;
}

}  // namespace dynslam::runtime
