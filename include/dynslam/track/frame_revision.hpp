// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <concepts>
#include <cstddef>
#include <optional>

#include "dynslam/geometry/rolling_shutter.hpp"
#include "dynslam/track/local_map_pose.hpp"

namespace dynslam {

/// Finds the pose of the last frame once more where rows are read one after the other: the next frame tells
/// how the camera moved at its time.
///
/// While a frame was at hand its rows went by the motion that had led to it, which is older than the frame by
/// half an interval; a hand's turn changes by 0.2 rad/s meanwhile. Half of that motion and half of the one
/// that leads on is the frame's own.
/// @tparam C  the camera as recorded
template <DifferentiableCamera C>
  requires std::floating_point<typename C::ScalarType>
class FrameRevision {
 public:
  using S = typename C::ScalarType;
  using Vector6 = typename SE3<S>::Vector6;

  explicit FrameRevision(const PoseTrackingOptions<S>& options) : options_(options) {}

  /// Moves `last` where that makes a pose, and with it the keyframe that it became.
  /// @param t, T_c_w  of the frame at hand, which is tracked
  /// @return the pose; empty: the last frame stays as it is
  template <class Map>
  std::optional<PoseResult<S>> revise(Map& map, LastFrame<S>& last, double t, const SE3<S>& T_c_w,
                                      LocalMapPose<C>& solver) {
    const auto after = last.interval(t);
    const double before = last.velocity_interval();
    if (!options_.revise || last.readout_time() == 0 || solver.readout() || !after || before <= 0)
      return std::nullopt;
    const Vector6 led_to = last.velocity().log() / static_cast<S>(before),
                  led_on = (T_c_w * last.frame().T_c_w.inverse()).log() / static_cast<S>(*after);
    const Vector6 speed =
        (static_cast<S>(*after) * led_to + static_cast<S>(before) * led_on) / static_cast<S>(before + *after);
    const RollingShutter<S> own{speed * static_cast<S>(last.readout_time()), last.height()};

    FeaturePlacer<C>& placer = solver.placer();
    const RollingShutter<S> present = placer.rolling_shutter();
    take(map, last.frame());
    placer.set_rolling_shutter(own);
    place_again(placer, last.placed_by(), last.keyframe().has_value());
    solver.estimate_readout_rotation(last, t, LocalMapPose<C>::Vector3::Zero());
    const PoseResult<S> pose = solver.optimiser().optimize(map, last.frame().T_c_w, frame_);
    const bool found = pose.inliers >= options_.min_inliers;
    if (found) {
      if (!pose.turn.isZero(0)) {
        placer.set_rolling_shutter(own.turned(pose.turn));
        place_again(placer, own, last.keyframe().has_value());
      }
      last.frame().T_c_w = pose.T_c_w;
      if (last.keyframe()) revise_keyframe(map, *last.keyframe(), pose.T_c_w, placer);
    }
    placer.set_rolling_shutter(present);
    return found ? std::optional(pose) : std::nullopt;
  }

 private:
  template <class Map>
  void take(const Map& map, const FeatureFrame<S>& last) {
    frame_.features = last.features;
    frame_.point = last.point;
    frame_.dynamic = last.dynamic;
    for (int& p : frame_.point) {
      if (p >= 0 && map.point(p).bad) p = -1;
    }
  }

  /// @param all  those without a match, too, which a keyframe alone needs
  void place_again(const FeaturePlacer<C>& placer, const RollingShutter<S>& placed_by, bool all) {
    for (std::size_t i = 0; i < frame_.features.size(); ++i) {
      if (all || frame_.point[i] >= 0) placer.place_again(frame_.features[i], placed_by);
    }
  }

  /// Has a keyframe go with the last frame, which it was made of, and with it the points that it alone has
  /// seen.
  template <class Map>
  void revise_keyframe(Map& map, int id, const SE3<S>& T_c_w, const FeaturePlacer<C>& placer) const {
    FeatureFrame<S>& kept = map.keyframe(id).frame;
    kept.features = frame_.features;
    kept.T_c_w = T_c_w;
    kept.grid.build(kept.features, placer.width(), placer.height());
    const SE3<S> T_w_c = kept.T_c_w.inverse();
    for (std::size_t i = 0; i < kept.point.size(); ++i) {
      if (kept.point[i] < 0 || !(kept.features[i].depth > 0)) continue;
      auto& point = map.point(kept.point[i]);
      if (point.keyframes.size() == 1) point.p_w = T_w_c * placer.point(kept.features[i]);
    }
  }

  PoseTrackingOptions<S> options_;
  FeatureFrame<S> frame_;  // features, points and flags of the last frame, whose memory is kept
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
