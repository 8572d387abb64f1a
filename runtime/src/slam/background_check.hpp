// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

#include "dynslam/runtime/slam/tracker_options.hpp"
#include "slam/frame_state.hpp"
#include "slam/last_images.hpp"
#include "slam/motion_detection.hpp"

namespace dynslam::runtime {

/// Checks a frame's pose by what lies behind, in the first frames of a map, and corrects it. Nothing was seen
/// to move yet then, and a dynamic object that has most of the features passes for the room. But the room is
/// what lies behind. Where that moves in another way than the pose says, by its grey values and by its
/// features, the pose follows a dynamic object, and what lies behind has its own way. A pose that hardly
/// rests on the foreground does not follow it, and is not checked.
class BackgroundCheck {
 public:
  /// @param margin  pixels around the foreground in which features are not used
  BackgroundCheck(const PoseSearchOptions& options, const AnyCamera<double>& camera, int margin)
      : options_(options), camera_(camera), margin_(margin) {}

  /// @param age     frames since the map was begun
  /// @param strict  see LocalMapPose::prove()
  /// Where the pose is corrected `now.foreground` is what it followed.
  void check(std::size_t age, bool strict, LocalMap& map, const LastFrame<double>& last, LastImages& images,
             MotionDetection& motion, PoseSolver& solver, FrameState& now) const;

 private:
  PoseSearchOptions options_;
  AnyCamera<double> camera_;
  int margin_;
};

}  // namespace dynslam::runtime
