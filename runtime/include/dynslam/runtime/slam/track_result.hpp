// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <string_view>

#include "dynslam/dynamics/mask_arbitration.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/runtime/slam/types.hpp"

namespace dynslam::runtime {

/// Parts of a frame's work, in the order of the columns of timings.csv. `tracking` is the tracking thread's
/// whole time; `features` are extracted ahead on the decoding thread where the pipeline says so.
enum class Stage {
  features,
  initial_pose,
  local_map,
  lucas_kanade,
  residuals,
  free_space,
  growing,
  pose,
  keyframe,
  tracking
};
/// Names of Stage, in its order.
inline constexpr std::array<std::string_view, 10> kStageNames{
    "features",   "initial_pose", "local_map", "lucas_kanade", "residuals",
    "free_space", "growing",      "pose",      "keyframe",     "tracking"};
/// Milliseconds of each stage.
struct StageTimes : std::array<double, kStageNames.size()> {
  using Base = std::array<double, kStageNames.size()>;
  using Base::operator[];
  [[nodiscard]] double& operator[](Stage stage) { return Base::operator[](static_cast<std::size_t>(stage)); }
};

/// Whether the camera is known in a frame.
enum class TrackingState { not_initialised, tracked, relocalised, lost };
/// Name of a state.
[[nodiscard]] std::string_view to_string(TrackingState state);

/// Where a frame is in a map that was begun since the camera was lost.
struct SeparatePose {
  int map = 0;        ///< its number, from 2: the main one is 1
  SE3<double> T_w_c;  ///< in a world of its own
};

/// The last frame's pose once more.
struct RevisedPose {
  double t = 0;         ///< its time [s]
  std::int64_t ns = 0;  ///< RgbdFrame::ns
  int reference = 0;    ///< as TrackResult has these
  SE3<double> T_c_reference;
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  int inliers = 0;
};

/// Value of TrackResult::dynamic_mask where something moves. Whoever asks for what moves compares with it.
inline constexpr std::uint8_t kMovesNow = 255;
/// And where something only may, by its class, and stands. A map of what will be there tomorrow leaves out both.
inline constexpr std::uint8_t kMayMove = 128;

/// What tracking a frame gave.
struct TrackResult {
  TrackingState state = TrackingState::not_initialised;
  [[nodiscard]] bool ok() const {
    return state == TrackingState::tracked || state == TrackingState::relocalised;
  }
  SE3<double> T_w_c;  ///< as known now; the final pose is T_c_reference's with the reference's last one
  int reference = 0;  ///< the newest keyframe
  SE3<double> T_c_reference;
  /// Of the left increment [m, rad] of T_c_w, by the noise of the matches alone; zero where none told the
  /// pose.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  bool keyframe = false;
  std::optional<LoopClosing> loop;                ///< closed at this keyframe: T_w_c is corrected already
  MaskVerdict mask_rejected = MaskVerdict::kept;  ///< why the pose was not found by the mask, if it was not
  int matches = 0, inliers = 0;
  std::optional<SeparatePose> separate;  ///< of a lost frame that another map has; see NewMapOptions
  std::optional<RevisedPose> revised;    ///< the frame before, by how the camera is known now to have moved
  /// What moves (kMovesNow) and what only may move, by its class, and stands (kMayMove); else 0. CV_8UC1, always of image
  /// size.
  cv::Mat dynamic_mask;
  StageTimes times{};
};

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
