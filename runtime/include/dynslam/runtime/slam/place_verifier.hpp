// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "dynslam/optim/absolute_pose.hpp"
#include "dynslam/optim/pose.hpp"
#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/slam/local_map.hpp"

namespace dynslam::runtime {

struct PlaceOptions {
  int min_matches = 15;        ///< by descriptor, before geometry is asked
  int min_inliers = 30;        ///< points that fit one pose in the end
  double min_agreement = 0.5;  ///< of the depths measured where its points should be and not hidden
  int neighbours = 5;          ///< keyframes around the candidate whose points are searched, too
  double nu = 5.0;             ///< t-distribution of the refinement
  std::uint64_t seed = 1;
};

/// A frame's pose in the part of the map that a keyframe shows.
struct PlaceMatch {
  SE3<double> T_c_w;
  Eigen::Matrix<double, 6, 6> covariance;    ///< of a left increment of T_c_w, from the noise of the matches
  std::vector<std::pair<int, int>> matches;  ///< feature, map point
};

/// Decides by geometry whether a frame shows the place that a keyframe shows.
class PlaceVerifier {
 public:
  PlaceVerifier(const CameraConfig& camera, const DepthNoise<double>& noise, const PlaceOptions& options)
      : camera_(camera), noise_(noise), options_(options) {}

  /// Descriptors propose matches with the keyframe's points, three of them a pose (absolute_pose); the
  /// points around the keyframe are searched from there, and what fits is refined. Two places may hold
  /// the same poster, so what else the map has in view must not be seen through by `depth`.
  /// @param depth  the frame's depth image, CV_32FC1 [m]
  /// @return nullopt when too few points or depths agree
  [[nodiscard]] std::optional<PlaceMatch> verify(LocalMap& map, const Frame& frame, const cv::Mat& depth,
                                                 int keyframe);

 private:
  void propose(const LocalMap& map, const Frame& frame, const Frame& keyframe);
  void search(LocalMap& map, const Frame& frame, int keyframe, const SE3<double>& T_c_w);
  [[nodiscard]] PoseResult<double> refine(const LocalMap& map, const Frame& frame, const SE3<double>& start);

  /// Share of the measured depths that agree with the points last searched, seen from T_c_w.
  [[nodiscard]] double agreement(const LocalMap& map, const cv::Mat& depth, const SE3<double>& T_c_w) const;

  CameraConfig camera_;
  DepthNoise<double> noise_;
  PlaceOptions options_;
  std::vector<std::pair<int, int>> matches_;  // feature, point
  std::vector<PoseObservation<double>> observations_;
  std::vector<int> point_of_feature_, distance_of_feature_;
  std::vector<int> searched_;  // points
  std::vector<std::uint8_t> tried_;
  std::vector<std::pair<int, int>> around_;
  AbsolutePoseWorkspace absolute_;
  PoseWorkspace<double> pose_;
};

}  // namespace dynslam::runtime
