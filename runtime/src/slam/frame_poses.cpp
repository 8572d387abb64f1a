// SPDX-License-Identifier: BSD-3-Clause
#include "slam/frame_poses.hpp"

#include <algorithm>

namespace dynslam::runtime {

void FramePoses::add(const RgbdFrame& frame, const TrackResult& result) {
  if (const auto& revised = result.revised; revised && !frames_.empty() && frames_.back().t == revised->t) {
    FramePose& last = frames_.back();
    last.reference = revised->reference;
    last.T_c_reference = revised->T_c_reference;
    last.covariance = revised->covariance.leftCols<3>().cast<float>();
  }
  const bool anew = result.state == TrackingState::relocalised;
  frames_.push_back({frame.t, frame.ns, result.reference, result.T_c_reference, result.keyframe, anew,
                     result.covariance.leftCols<3>().cast<float>()});
}

void FramePoses::take(const FramePoses& other, int first_keyframe) {
  frames_.reserve(frames_.size() + other.frames_.size());
  ++taken_;
  for (FramePose frame : other.frames_) {
    frame.reference += first_keyframe;
    frame.world = taken_;
    frames_.push_back(frame);
  }
  std::stable_sort(frames_.begin(), frames_.end(), [](const auto& a, const auto& b) { return a.t < b.t; });
}

SE3<double> FramePoses::T_c_w(const FramePose& frame, const LocalMap& map) {
  return frame.T_c_reference * map.pose(frame.reference);
}

std::optional<SE3<double>> FramePoses::pose_at(double t, const LocalMap& map) const {
  const auto it = std::lower_bound(frames_.begin(), frames_.end(), t,
                                   [](const FramePose& frame, double time) { return frame.t < time; });
  if (it == frames_.end() || it->t != t) return std::nullopt;
  return T_c_w(*it, map).inverse();
}

std::vector<StampedPose<double>> FramePoses::poses(const LocalMap& map, bool keyframes_alone) const {
  std::vector<StampedPose<double>> result;
  for (const FramePose& frame : frames_) {
    if (keyframes_alone && !frame.keyframe) continue;
    result.push_back({frame.t, T_c_w(frame, map).inverse(), frame.ns});
  }
  return result;
}

std::vector<StampedPose<double>> FramePoses::smoothed(const LocalMap& map,
                                                      const SmoothingOptions& options) const {
  std::vector<TrackedPose<double>> tracked(frames_.size());
  for (std::size_t i = 0; i < frames_.size(); ++i) {
    const FramePose& frame = frames_[i];
    TrackedPose<double>& pose = tracked[i];
    pose.t = frame.t;
    pose.T_c_w = T_c_w(frame, map);
    pose.covariance.leftCols<3>() = frame.covariance.cast<double>();
    pose.begins = frame.relocalised || (i > 0 && frame.world != frames_[i - 1].world);
  }
  (void)smooth_trajectory<double>(tracked, options);  // what it cannot smooth it leaves
  std::vector<StampedPose<double>> result;
  for (std::size_t i = 0; i < frames_.size(); ++i)
    result.push_back({frames_[i].t, tracked[i].T_c_w.inverse(), frames_[i].ns});
  return result;
}

}  // namespace dynslam::runtime
