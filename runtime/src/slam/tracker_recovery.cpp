// SPDX-License-Identifier: BSD-3-Clause
// What a loss leaves behind: once the camera is known on both sides of it, its frames are looked for again.
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "slam/tracker_present.hpp"

namespace dynslam::runtime {

void Tracker::remember_lost(Present& now) {
  const std::size_t most = options_.method == Method::full ? options_.search.recovered_frames : 0;
  // In a map that was loaded nothing is known of the camera before.
  if (static_cast<std::size_t>(lost_frames_) >= most || last_.features.empty()) {
    lost_.clear();
    return;
  }
  if (lost_.empty()) {
    lost_velocity_ = velocity_;
    lost_interval_ = velocity_interval_;
  }
  auto image = std::make_shared<ImageFeatures>();
  image->pyramid = now.image->pyramid;
  cv::Mat& base = image->pyramid.levels.front();
  base = base.clone();  // it may be the caller's
  matcher_.clear(now.frame);
  lost_.push_back({.t = now.input.t,
                   .depth_delay = now.input.depth_delay,
                   .ns = now.input.ns,
                   .depth = now.input.depth.clone(),
                   .image = std::move(image),
                   .frame = std::move(now.frame),
                   .pose = {}});
}

void Tracker::recover(Present& now) {
  if (lost_.empty()) return;
  std::vector<std::pair<int, int>> sights;  // of the map's points: how often visible and found
  for (const MapPoint& p : map_.points()) sights.emplace_back(p.visible, p.found);
  std::vector<Lost> lost = std::exchange(lost_, {});
  // Known poses, those of the frames in between as they are found. The first tells how the camera moved then.
  const auto n = static_cast<std::ptrdiff_t>(lost.size());
  const auto known = [&](std::ptrdiff_t i) -> std::optional<TimedPose<double>> {
    if (i == -1) return TimedPose<double>{last_.t, last_.T_c_w};
    if (i == n) return TimedPose<double>{now.frame.t, now.frame.T_c_w};
    if (i >= 0 && i < n && lost[static_cast<std::size_t>(i)].pose)
      return TimedPose<double>{lost[static_cast<std::size_t>(i)].t,
                               lost[static_cast<std::size_t>(i)].pose->T_c_w};
    if (i == -2 && lost_interval_ > 0)
      return TimedPose<double>{last_.t - lost_interval_, lost_velocity_.inverse() * last_.T_c_w};
    return std::nullopt;
  };
  std::vector<TimedPose<double>> around;
  const auto visit = [&](std::ptrdiff_t i) {
    around.clear();
    constexpr std::size_t kEachSide = 2;
    for (std::ptrdiff_t k = i - 1; k >= -2 && around.size() < kEachSide; --k)
      if (const auto pose = known(k)) around.push_back(*pose);
    const std::size_t before = around.size();
    for (std::ptrdiff_t k = i + 1; k <= n && around.size() < before + kEachSide; ++k)
      if (const auto pose = known(k)) around.push_back(*pose);
    if (before > 1) std::swap(around[1], around[before]);  // the nearest of either side come first
    locate_again(lost[static_cast<std::size_t>(i)], around);
  };
  // From the end, where the map has what came into view meanwhile; then each between its neighbours. What is
  // found leads to more.
  constexpr int kRounds = 2;
  for (int round = 0; round < kRounds; ++round) {
    for (std::ptrdiff_t i = n; i-- > 0;) visit(i);
    for (std::ptrdiff_t i = 0; i < n; ++i) visit(i);
  }

  const SE3<double> T_reference_w = map_.pose(now.result.reference);
  for (const Lost& l : lost) {
    if (!l.pose) continue;
    now.result.recovered.push_back({.t = l.t,
                                    .ns = l.ns,
                                    .reference = now.result.reference,
                                    .T_c_reference = l.pose->T_c_w * T_reference_w.inverse(),
                                    .covariance = l.pose->covariance,
                                    .inliers = l.pose->inliers});
  }
  if (lost.back().pose) {
    velocity_ = now.frame.T_c_w * lost.back().pose->T_c_w.inverse();
    velocity_interval_ = now.frame.t - lost.back().t;
  }
  // Points that were hidden all along are no worse for having been looked for so often.
  for (std::size_t p = 0; p < sights.size(); ++p) {
    MapPoint& point = map_.point(static_cast<int>(p));
    point.visible = sights[p].first;
    point.found = sights[p].second;
  }
}

/// @param around  known poses, the nearest before it and the nearest after it first
void Tracker::locate_again(Lost& lost, std::span<const TimedPose<double>> around) {
  const PoseSearchOptions& o = options_.search;
  // In a jerk a line is far off. Over a long loss two poses that lie close together tell nothing of the
  // velocity, and the curve through them runs away.
  const std::array<SE3<double>, 2> expected{pose_between<double>(around, lost.t),
                                            pose_between<double>(around.first(2), lost.t)};
  // How it moved meanwhile places the rows, and the depth image.
  constexpr double kStep = 1e-3;  // [s]
  const SE3<double>::Vector6 speed =
      (pose_between<double>(around, lost.t + kStep) * expected.front().inverse()).log() / kStep;
  const bool delayed = lost.depth_delay != 0 && std::abs(lost.depth_delay) < o.longest_delay;
  FeaturePlacer<decltype(CameraConfig::model)>& placer = matcher_.placer();
  placer.set_depth_motion(delayed ? std::optional(SE3<double>::exp(speed * lost.depth_delay)) : std::nullopt);
  placer.set_rolling_shutter(camera_.readout_time == 0
                                 ? RollingShutter<double>()
                                 : RollingShutter<double>{speed * camera_.readout_time, camera_.height});
  pose_.set_rows_known();

  Frame& frame = lost.frame;
  const auto depth = interop::view<const float>(std::as_const(lost.depth));
  matcher_.begin(frame);
  placer.place(std::span<Feature>(frame.features), depth);
  const double reach = o.recovered_speed * std::min(lost.t - around[0].t, around[1].t - lost.t);
  const auto led_to = [&](const SE3<double>& T_c_w) {
    return std::any_of(expected.begin(), expected.end(), [&](const SE3<double>& there) {
      const SE3<double> beside = T_c_w * there.inverse();
      return beside.translation().norm() <= reach && beside.so3().log().norm() <= reach;
    });
  };
  std::optional<PoseResult<double>> best;
  // @param near  it is the pose to within pixels
  const auto look_from = [&](const SE3<double>& start, bool near) {
    constexpr int kLooks = 4;
    PoseResult<double> pose;
    pose.T_c_w = start;
    for (int look = 0, before = 0; look < (near ? 1 : kLooks); ++look, before = pose.inliers) {
      matcher_.match_local(map_, pose.T_c_w, lost.image->pyramid, depth, frame);
      pose_.gather(map_, frame);
      if (near || look > 0) pose_.keep_consistent(pose.T_c_w, o.local_chi2, frame);
      pose = pose_.optimize(map_, pose.T_c_w, frame);
      if (pose.inliers < o.weak_inliers || (look > 0 && pose.inliers <= before)) break;
    }
    matcher_.clear(frame);
    if (pose.inliers < o.recovered_inliers || !led_to(pose.T_c_w)) return;
    if (!best || pose.inliers > best->inliers) best = pose;
  };
  if (lost.pose) look_from(lost.pose->T_c_w, true);
  for (const SE3<double>& there : expected) {
    if (!best || best->inliers < o.sure_inliers) look_from(there, false);
  }
  lost.pose = std::move(best);
}

}  // namespace dynslam::runtime
