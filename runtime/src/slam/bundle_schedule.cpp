// SPDX-License-Identifier: BSD-3-Clause
#include "slam/bundle_schedule.hpp"

namespace dynslam::runtime {

void BundleSchedule::request(std::size_t frame, bool after_loop) {
  wanted_window_ = after_loop ? options_.loop_window : 0;
  due_ = frame + static_cast<std::size_t>(after_loop ? options_.loop_delay : options_.delay);
}

void BundleSchedule::start(const LocalMap& map) {
  if (!wanted_window_) return;
  bundle_.start(map, options_.depth_noise, *wanted_window_);
  wanted_window_.reset();
}

std::optional<SE3<double>> BundleSchedule::apply(LocalMap& map, PlaceIndex& places) {
  start(map);
  if (!bundle_.pending()) return std::nullopt;
  const SE3<double> D = bundle_.apply(map);
  ++adjustments_;
  for (const int id : map.cull_keyframes(map.newest(), options_.redundant_keyframe, options_.spare_keyframes))
    places.remove(id);
  return D;
}

}  // namespace dynslam::runtime
