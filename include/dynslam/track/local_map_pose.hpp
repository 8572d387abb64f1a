// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <concepts>
#include <optional>
#include <span>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/features/masked_features.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/geometry/rolling_shutter.hpp"
#include "dynslam/map/local_matcher.hpp"
#include "dynslam/map/matched_pose.hpp"
#include "dynslam/optim/readout_measurement.hpp"
#include "dynslam/track/pose_estimate.hpp"

namespace dynslam {

/// The pose of a frame on the local map, from a start nearby; and where its features are placed meanwhile, as
/// the motion of the camera while the images are taken becomes known.
/// @tparam C  the camera as recorded
template <DifferentiableCamera C>
  requires std::floating_point<typename C::ScalarType>
class LocalMapPose {
 public:
  using S = typename C::ScalarType;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  using Estimate = PoseEstimate<S>;

  /// An estimate to come back to.
  struct Attempt {
    Estimate estimate;
    RollingShutter<S> shutter;
  };

  /// @param scales  of the pyramid levels on which features are found, see LocalMatcher
  LocalMapPose(const C& camera, int width, int height, std::span<const float> scales,
               const LocalMatchOptions<S>& matching, const MatchedPoseOptions<S>& pose,
               const PoseTrackingOptions<S>& options)
      : matcher_(camera, width, height, scales, matching),
        optimiser_(matcher_.placer().pinhole(), pose),
        options_(options) {}

  [[nodiscard]] LocalMatcher<C>& matcher() { return matcher_; }
  [[nodiscard]] FeaturePlacer<C>& placer() { return matcher_.placer(); }
  [[nodiscard]] const FeaturePlacer<C>& placer() const { return matcher_.placer(); }
  [[nodiscard]] MatchedPose<S>& optimiser() { return optimiser_; }

  /// Has the frames from now on measure the readout time; their turns are not estimated then, which would
  /// explain the same.
  void measure_readout() { readout_.emplace(); }
  [[nodiscard]] const std::optional<ReadoutMeasurement<S>>& readout() const { return readout_; }

  /// Takes a frame with its extracted features, each with its recorded pixel, and places them by the motion
  /// so far.
  template <class E>
  void begin(const E& from, Estimate& now) {
    set_motion(from, from.last.velocity());
    FeatureFrame<S>& frame = now.frame;
    place(from, frame);
    frame.point.assign(frame.features.size(), -1);
    frame.dynamic.assign(frame.features.size(), 0);
    frame.grid.build(frame.features, placer().width(), placer().height());
    matcher_.begin(frame);
  }
  /// Forgets what was matched and how the camera was found to move.
  template <class E>
  void restart(const E& from, Estimate& now) {
    matcher_.clear(now.frame);
    place_by_motion(from, from.last.velocity(), now);
  }

  /// Matches the points of the local map from now.frame.T_c_w, and optimises the pose.
  /// @param strict  matches that are far off never enter the optimisation
  /// @return whether `required` of them fit it
  template <class E>
  bool prove(const E& from, int required, bool strict, Estimate& now) {
    FeatureFrame<S>& frame = now.frame;
    // The motion that was found is used instead of the one before it.
    if (from.last.interval(from.time.t) && (from.time.depth_delay != 0 || from.last.readout_time() != 0))
      place_by_motion(from, from.motion_to(frame.T_c_w), now);
    matcher_.match_local(from.map, frame.T_c_w, from.pyramid, from.depth, frame);
    if (from.left_out.width() > 0) flag_masked(from.left_out, frame.features, frame.dynamic);
    if (strict) {
      // The pose is good to a fraction of a pixel already. What is farther off moves, and were it let in, a
      // robust kernel would give it its share.
      optimiser_.gather(from.map, frame);
      optimiser_.keep_consistent(frame.T_c_w, options_.local_chi2, frame);
    }
    estimate_readout_rotation(from.last, from.time.t, now.turn);
    const PoseResult<S> pose = optimiser_.optimize(from.map, frame.T_c_w, frame);
    now.take(pose);
    if (pose.inliers < required) return false;
    apply_readout_rotation(from, pose.turn, now);
    return true;
  }

  /// The same, again and again for as long as more points fit. From a poor start the local map's points may
  /// be matched to a pose that is centimetres off, and still be many. Another look from there finds those
  /// that were missed, and so on.
  /// @param strict_from  look from which on matches that are far off are kept out: 0, the first; 1 where the
  ///                     start is good to some pixels only and the first look would lose the true ones
  template <class E>
  bool refine(const E& from, int required, int strict_from, Estimate& now) {
    int most = 0;
    for (int pass = 0; pass < options_.settling_passes; ++pass) {
      if (!prove(from, std::min(required, options_.min_inliers), pass >= strict_from, now)) return false;
      const bool grows = static_cast<S>(now.inliers) >= options_.settling_growth * static_cast<S>(most);
      most = std::max(most, now.inliers);
      if (!grows) break;
    }
    return most >= required;
  }

  /// Has the next optimisation estimate how the camera turned while it read its rows. A measurement of the
  /// readout time would find nothing then: the turn explains the same.
  /// @param turn  that the placer has beyond the motion between frames [rad]
  void estimate_readout_rotation(const LastFrame<S>& last, double t, const Vector3& turn) {
    optimiser_.set_rows_known();
    if (!(options_.turn_doubt > 0) || readout_ || !last.interval(t)) return;
    optimiser_.set_rows(placer().rolling_shutter(),
                        {-turn, options_.turn_doubt * static_cast<S>(last.readout_time())});
  }
  /// Places the features by the turn that was found.
  template <class E>
  void apply_readout_rotation(const E& from, const Vector3& turn, Estimate& now) {
    if (turn.isZero(0)) return;
    now.turn += turn;
    placer().set_rolling_shutter(placer().rolling_shutter().turned(turn));
    place(from, now.frame);
  }
  /// Lets the frame whose pose was found last tell how long its rows take, where that is measured.
  template <class E>
  void add_to_readout(const E& from, const Estimate& now) {
    const auto since_last = from.last.interval(from.time.t);
    if (!readout_ || !since_last) return;
    const SE3<S>& T_c_w = now.frame.T_c_w;
    optimiser_.measure_readout(now.frame, T_c_w, from.last.speed(from.motion_to(T_c_w), *since_last),
                               from.last.height(), *readout_);
  }

  [[nodiscard]] Attempt save(const Estimate& now) const { return {now, placer().rolling_shutter()}; }
  template <class E>
  void restore(const E& from, const Attempt& earlier, Estimate& now) {
    now = earlier.estimate;
    placer().set_depth_motion(from.last.depth_motion(from.time, from.motion_to(now.frame.T_c_w)));
    placer().set_rolling_shutter(earlier.shutter);
  }

 private:
  /// Tells the placer how the camera moves while the images are taken.
  template <class E>
  void set_motion(const E& from, const SE3<S>& T_c_last) {
    placer().set_depth_motion(from.last.depth_motion(from.time, T_c_last));
    placer().set_rolling_shutter(from.last.shutter(from.time.t, T_c_last));
  }
  template <class E>
  void place(const E& from, FeatureFrame<S>& frame) const {
    placer().place(std::span<Feature>(frame.features), from.depth);
  }
  template <class E>
  void place_by_motion(const E& from, const SE3<S>& T_c_last, Estimate& now) {
    set_motion(from, T_c_last);
    now.turn.setZero();
    place(from, now.frame);
  }

  LocalMatcher<C> matcher_;
  MatchedPose<S> optimiser_;
  PoseTrackingOptions<S> options_;
  std::optional<ReadoutMeasurement<S>> readout_;
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
