// SPDX-License-Identifier: BSD-3-Clause
// How the camera moves while a frame's images are taken: depth comes later than colour, rows one after the
// other.
#include <cmath>
#include <optional>
#include <span>

#include "slam/tracker_present.hpp"

namespace dynslam::runtime {

void Tracker::set_motion(const Present& now, const SE3<double>& T_c_last) {
  matcher_.placer().set_depth_motion(depth_motion(now.input, T_c_last));
  matcher_.placer().set_rolling_shutter(shutter(now.input, T_c_last));
}

std::optional<double> Tracker::interval(const RgbdFrame& input) const {
  const double interval = input.t - last_.t;
  if (!initialised_ || lost_frames_ > 0 || interval <= 0 || interval >= 4 * options_.search.longest_delay)
    return std::nullopt;
  return interval;
}

double Tracker::depth_delay(const RgbdFrame& input) const {
  return interval(input) && std::abs(input.depth_delay) < options_.search.longest_delay ? input.depth_delay
                                                                                        : 0;
}

std::optional<SE3<double>> Tracker::depth_motion(const RgbdFrame& input, const SE3<double>& T_c_last) const {
  const double delay = depth_delay(input);
  if (delay == 0) return std::nullopt;
  return SE3<double>::exp(T_c_last.log() * (delay / *interval(input)));
}

RollingShutter<double> Tracker::shutter(const RgbdFrame& input, const SE3<double>& T_c_last) const {
  const auto since_last = interval(input);
  if (camera_.readout_time == 0 || !since_last) return {};
  return {speed(T_c_last, *since_last) * camera_.readout_time, camera_.height};
}

SE3<double>::Vector6 Tracker::speed(const SE3<double>& T_c_last, double interval) const {
  SE3<double>::Vector6 result = T_c_last.log() / interval;
  // That was the speed half an interval ago. Half of what it has gained since is added: all of it would be
  // right on average, but poses have noise, and its share would be larger than the gain.
  if (velocity_interval_ > 0) result += 0.25 * (result - velocity_.log() / velocity_interval_);
  return result;
}

/// Places the features by the motion that was found instead of the one before it.
void Tracker::place_again(Present& now) {
  if (!interval(now.input) || (now.input.depth_delay == 0 && camera_.readout_time == 0)) return;
  set_motion(now, now.T_c_w * last_.T_c_w.inverse());
  now.turn.setZero();
  place_features(now);
}

void Tracker::place_features(Present& now) const {
  matcher_.placer().place(std::span<Feature>(now.frame.features), now.depth);
}

/// Has the next optimisation ask how the camera turned while it read its rows. A measurement of the readout
/// time would find nothing then: the turn explains the same.
/// @param turn  that the placer has beyond the motion between frames
void Tracker::look_for_turn(const Present& now, const Eigen::Vector3d& turn) {
  pose_.set_rows_known();
  if (!(options_.search.turn_doubt > 0) || readout_ || !interval(now.input)) return;
  pose_.set_rows(matcher_.placer().rolling_shutter(),
                 {-turn, options_.search.turn_doubt * camera_.readout_time});
}

/// Places the features by the turn that was found.
void Tracker::take_turn(Present& now, const Eigen::Vector3d& turn) {
  if (turn.isZero(0)) return;
  now.turn += turn;
  matcher_.placer().set_rolling_shutter(matcher_.placer().rolling_shutter().turned(turn));
  place_features(now);
}

/// Asks the frame whose pose was found last how long its rows take.
void Tracker::measure_rows(const Present& now) {
  const auto since_last = interval(now.input);
  if (!readout_ || !since_last) return;
  pose_.measure_readout(now.frame, now.T_c_w, speed(now.T_c_w * last_.T_c_w.inverse(), *since_last),
                        camera_.height, *readout_);
}

bool Tracker::reachable(const SE3<double>& T_c_w, double t) const {
  if (last_.features.empty()) return true;  // a map was loaded: the camera may be anywhere in it
  const SE3<double> step = T_c_w * last_.T_c_w.inverse();
  const double interval = t - last_.t;
  return step.translation().norm() <= options_.search.max_speed * interval &&
         step.so3().log().norm() <= options_.search.max_turn * interval;
}

}  // namespace dynslam::runtime
