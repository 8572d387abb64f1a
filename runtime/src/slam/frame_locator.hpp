// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/runtime/slam/tracker_options.hpp"
#include "slam/frame_state.hpp"
#include "slam/last_images.hpp"

namespace dynslam::runtime {

/// Finds the pose of a frame while the camera is known, with an a-priori mask, or without it where that says
/// more.
class FrameLocator {
 public:
  FrameLocator(const TrackerOptions& options, const AnyCamera<double>& camera);

  /// Without another mask than the frame has. @return whether there is a pose
  bool locate(LocalMap& map, const LastFrame<double>& last, LastImages& images, PoseSolver& solver,
              FrameState& now);
  /// A mask that leaves little is wrong, or a person stands right before the camera. The pose is then
  /// searched for on what it leaves and on all that there is. The mask goes where it leaves no pose, or hides
  /// much that moves as the rest does; and where what it leaves has led farther from where the camera was
  /// going.
  bool locate_with_prior(LocalMap& map, const LastFrame<double>& last, LastImages& images, PoseSolver& solver,
                         FrameState& now);
  /// From the last frame's grey values alone, with as many inliers as make a start.
  bool locate_by_alignment(LocalMap& map, const LastFrame<double>& last, LastImages& images,
                           PoseSolver& solver, FrameState& now);

  [[nodiscard]] bool strict(const FrameState& now) const { return search_.strict(now.pose); }

 private:
  PoseSearchOptions options_;
  MaskArbitrationOptions<double> arbitration_;
  AnyCamera<double> camera_;
  PoseSearch<AnyCamera<double>> search_;
};

}  // namespace dynslam::runtime
