// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cmath>
#include <concepts>
#include <cstdint>
#include <optional>
#include <utility>

#include "dynslam/geometry/rolling_shutter.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/map/feature_frame.hpp"
#include "dynslam/track/pose_tracking_options.hpp"

namespace dynslam {

/// When a frame's images were taken.
struct FrameTime {
  double t = 0;            ///< of the colour image [s]
  double depth_delay = 0;  ///< depth time less colour time [s]
  std::int64_t ns = 0;     ///< t in nanoseconds, as it was recorded; 0: unknown
};

/// The last frame that was tracked, and how the camera moved to it: the motion model. While the camera is
/// lost the frame stays, and the frames since are counted.
template <std::floating_point S>
class LastFrame {
 public:
  using Frame = FeatureFrame<S>;
  using Vector6 = typename SE3<S>::Vector6;

  /// @param readout_time  from the first row of an image to the last [s]; 0: all rows at once
  /// @param height        of the image [px]
  LastFrame(const PoseTrackingOptions<S>& options, double readout_time, int height)
      : options_(options), readout_time_(readout_time), height_(height) {}

  /// @name The last frame
  /// @{
  [[nodiscard]] const Frame& frame() const { return frame_; }
  [[nodiscard]] Frame& frame() { return frame_; }
  [[nodiscard]] const FrameTime& time() const { return time_; }
  /// By which its features were placed.
  [[nodiscard]] const RollingShutter<S>& placed_by() const { return placed_by_; }
  /// The newest keyframe when it was tracked.
  [[nodiscard]] int reference() const { return reference_; }
  /// The keyframe that it became, until release_keyframe().
  [[nodiscard]] const std::optional<int>& keyframe() const { return keyframe_; }
  void release_keyframe() { keyframe_.reset(); }
  /// Whether there is none: the camera may be anywhere in a map that was loaded.
  [[nodiscard]] bool empty() const { return frame_.features.empty(); }
  /// @}

  /// @name What changes it
  /// @{
  /// The frame at hand was tracked: its pose says how the camera moved.
  void accept(const SE3<S>& T_c_w, double t) {
    velocity_interval_ = interval(t).value_or(0);
    velocity_ = lost_frames_ == 0 ? T_c_w * frame_.T_c_w.inverse() : SE3<S>();
    lost_frames_ = 0;
  }
  /// And takes the place of the one before.
  void replace(Frame&& frame, const FrameTime& time, const RollingShutter<S>& placed_by, int reference,
               const std::optional<int>& keyframe) {
    frame_ = std::move(frame);
    time_ = time;
    placed_by_ = placed_by;
    reference_ = reference;
    keyframe_ = keyframe;
    known_ = true;
  }
  /// The frame at hand was lost, or a map was loaded.
  void lose() { ++lost_frames_; }
  /// @param interval  over which it was measured [s]; 0: that is not known
  void set_velocity(const SE3<S>& T_c_last, double interval) {
    velocity_ = T_c_last;
    velocity_interval_ = interval;
  }
  /// The map was corrected: new T_c_w = old T_c_w D.
  void follow(const SE3<S>& D) { frame_.T_c_w = frame_.T_c_w * D; }
  /// @}

  /// @name How the camera moves
  /// @{
  [[nodiscard]] int lost_frames() const { return lost_frames_; }
  /// T_c_last of the last two frames that were tracked one after the other.
  [[nodiscard]] const SE3<S>& velocity() const { return velocity_; }
  [[nodiscard]] double velocity_interval() const { return velocity_interval_; }
  [[nodiscard]] double readout_time() const { return readout_time_; }
  [[nodiscard]] int height() const { return height_; }

  /// From the last frame to the one at hand, at constant velocity.
  [[nodiscard]] SE3<S> predicted_motion() const {
    return SE3<S>::exp(velocity_.log() * static_cast<S>(lost_frames_ + 1));
  }
  [[nodiscard]] SE3<S> predicted_pose() const { return predicted_motion() * frame_.T_c_w; }

  /// Time since the last frame, where the motion since then tells of the motion during this one [s].
  [[nodiscard]] std::optional<double> interval(double t) const {
    const double interval = t - frame_.t;
    if (!known_ || lost_frames_ > 0 || interval <= 0 || interval >= options_.longest_motion())
      return std::nullopt;
    return interval;
  }
  /// Where the camera was when the depth image was taken, by its motion since the last frame; empty: at once
  /// with colour, or not known.
  [[nodiscard]] std::optional<SE3<S>> depth_motion(const FrameTime& time, const SE3<S>& T_c_last) const {
    const auto since_last = interval(time.t);
    if (!since_last || time.depth_delay == 0 || !(std::abs(time.depth_delay) < options_.longest_delay))
      return std::nullopt;
    return SE3<S>::exp(T_c_last.log() * static_cast<S>(time.depth_delay / *since_last));
  }
  /// How it moved while the colour image was read, by the same.
  [[nodiscard]] RollingShutter<S> shutter(double t, const SE3<S>& T_c_last) const {
    const auto since_last = interval(t);
    if (readout_time_ == 0 || !since_last) return {};
    return {speed(T_c_last, *since_last) * static_cast<S>(readout_time_), height_};
  }
  /// The camera's speed at a frame [m/s, rad/s]. @param interval  since the last [s]
  [[nodiscard]] Vector6 speed(const SE3<S>& T_c_last, double interval) const {
    Vector6 result = T_c_last.log() / static_cast<S>(interval);
    // That was the speed half an interval ago. Half of what it has gained since is added: all of it would be
    // right on average, but poses have noise, and its share would be larger than the gain.
    if (velocity_interval_ > 0)
      result += S(0.25) * (result - velocity_.log() / static_cast<S>(velocity_interval_));
    return result;
  }
  /// Whether the camera can have come to a pose since.
  [[nodiscard]] bool reachable(const SE3<S>& T_c_w, double t) const {
    if (empty()) return true;
    const SE3<S> step = T_c_w * frame_.T_c_w.inverse();
    const S interval = static_cast<S>(t - frame_.t);
    return step.translation().norm() <= options_.max_speed * interval &&
           step.so3().log().norm() <= options_.max_turn * interval;
  }
  /// @}

 private:
  PoseTrackingOptions<S> options_;
  double readout_time_;
  int height_;
  Frame frame_;
  FrameTime time_;
  RollingShutter<S> placed_by_;
  int reference_ = 0;
  std::optional<int> keyframe_;
  bool known_ = false;
  SE3<S> velocity_;
  double velocity_interval_ = 0;
  int lost_frames_ = 0;
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
