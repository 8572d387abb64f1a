// SPDX-License-Identifier: BSD-3-Clause
// The next frame tells how the camera moved while the one before was read: that one is placed once more.
#include <cstddef>
#include <optional>

#include "slam/tracker_present.hpp"

namespace dynslam::runtime {

/// While a frame was at hand its rows went by the motion that had led to it, which is older than the frame by
/// half an interval; a hand's turn changes by 0.2 rad/s meanwhile. Half of that motion and half of the one
/// that leads on is the frame's own.
void Tracker::revise_last(Present& now) {
  const PoseSearchOptions& o = options_.search;
  const auto after = interval(now.input);
  const double before = velocity_interval_;
  if (!o.revise || options_.method != Method::full || camera_.readout_time == 0 || readout_ || !after ||
      before <= 0)
    return;
  const SE3<double>::Vector6 led_to = velocity_.log() / before,
                             led_on = (now.T_c_w * last_.T_c_w.inverse()).log() / *after;
  const SE3<double>::Vector6 speed = (*after * led_to + before * led_on) / (before + *after);
  const RollingShutter<double> own{speed * camera_.readout_time, camera_.height};

  FeaturePlacer<decltype(CameraConfig::model)>& placer = matcher_.placer();
  const RollingShutter<double> present = placer.rolling_shutter();
  const auto replace = [&](const RollingShutter<double>& placed_by) {
    for (std::size_t i = 0; i < revised_.features.size(); ++i) {  // what has no match a keyframe alone needs
      if (inserted_ || revised_.point[i] >= 0) placer.place_again(revised_.features[i], placed_by);
    }
  };
  revised_.features = last_.features;
  revised_.point = last_.point;
  revised_.dynamic = last_.dynamic;
  for (int& p : revised_.point) {
    if (p >= 0 && map_.point(p).bad) p = -1;
  }
  placer.set_rolling_shutter(own);
  replace(last_shutter_);
  look_for_turn(now, Eigen::Vector3d::Zero());
  const PoseResult<double> pose = pose_.optimize(map_, last_.T_c_w, revised_);
  if (pose.inliers >= o.min_inliers) {
    if (!pose.turn.isZero(0)) {
      placer.set_rolling_shutter(own.turned(pose.turn));
      replace(own);
    }
    last_.T_c_w = pose.T_c_w;
    if (inserted_) revise_keyframe(*inserted_);
    now.result.revised = RecoveredPose{.t = last_.t,
                                       .ns = last_ns_,
                                       .reference = last_reference_,
                                       .T_c_reference = last_.T_c_w * map_.pose(last_reference_).inverse(),
                                       .covariance = pose.covariance,
                                       .inliers = pose.inliers};
  }
  placer.set_rolling_shutter(present);
}

/// Has a keyframe go with the last frame, which it was made of, and with it the points that it alone has
/// seen.
void Tracker::revise_keyframe(int id) {
  Frame& kept = map_.keyframe(id).frame;
  kept.features = revised_.features;
  kept.T_c_w = last_.T_c_w;
  kept.grid.build(kept.features, camera_.width, camera_.height);
  const SE3<double> T_w_c = kept.T_c_w.inverse();
  for (std::size_t i = 0; i < kept.point.size(); ++i) {
    if (kept.point[i] < 0 || !(kept.features[i].depth > 0)) continue;
    MapPoint& point = map_.point(kept.point[i]);
    if (point.keyframes.size() == 1) point.p_w = T_w_c * matcher_.placer().point(kept.features[i]);
  }
}

}  // namespace dynslam::runtime
