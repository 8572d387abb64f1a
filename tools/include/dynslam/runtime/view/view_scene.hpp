// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "dynslam/eval/trajectory.hpp"
#include "dynslam/interop/octomap_semantic_tree.hpp"
#include "dynslam/runtime/io/map_io.hpp"
#include "dynslam/runtime/slam/dynamics_mode.hpp"
#include "dynslam/runtime/slam/track_result.hpp"

namespace dynslam::runtime {

/// A keypoint that the geometry judged.
struct ViewKeypoint {
  cv::Point2f pixel;  ///< in the recorded image [px]
  double weight = 1;  ///< static weight, Eq (7): 0 moves, 1 stands still
};

/// What a view shows of a frame.
struct ViewFrame {
  std::size_t number = 0, total = 0;  ///< the first is 1; frames of the sequence, 0: unknown
  double seconds = 0;                 ///< since the first frame shown
  TrackingState state = TrackingState::not_initialised;
  bool keyframe = false;
  int matches = 0, inliers = 0;
  cv::Mat bgr;                          ///< CV_8UC3; empty: no frame yet
  cv::Mat semantic, geometric;          ///< masks, CV_8UC1 of the image's size; empty: none
  std::vector<ViewKeypoint> keypoints;  ///< empty where the geometry was not asked
};

/// An occupied voxel.
struct ViewVoxel {
  Eigen::Vector3f centre;  ///< [m]
  float edge = 0;          ///< [m]
  std::uint8_t label = 0;
  Rgb colour{};  ///< voxel_colour()
};

/// The occupied voxels of a map; where they are more than `most`, eight are taken as one, as often as it
/// takes.
[[nodiscard]] std::vector<ViewVoxel> view_voxels(const interop::SemanticOcTree& tree,
                                                 std::size_t most = 200'000);

/// What a view shows: the frame at hand and what has become known until it.
struct ViewScene {
  ViewFrame frame;
  std::vector<StampedPose<double>> trajectory;  ///< T_w_c by time; the last one is where the camera is now
  std::vector<StampedPose<double>> truth;       ///< ground truth, in the trajectory's world; may be empty
  std::vector<ViewVoxel> voxels;
  MapClasses classes{};         ///< names of their labels
  std::size_t map_version = 0;  ///< another number where `voxels` are others
  bool paused = false;
};

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
