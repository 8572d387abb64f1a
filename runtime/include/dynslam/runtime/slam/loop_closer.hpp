// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <opencv2/core.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "dynslam/optim/pose_graph.hpp"
#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/slam/local_map.hpp"
#include "dynslam/runtime/slam/place_index.hpp"
#include "dynslam/runtime/slam/place_verifier.hpp"

namespace dynslam::runtime {

struct LoopOptions {
  int min_votes = 25;          ///< descriptors in common from which geometry is asked
  int candidates = 3;          ///< keyframes that geometry is asked about
  int min_inliers = 60;        ///< points that fit one pose: a false loop costs more than a missed one
  double min_agreement = 0.8;  ///< of depths, see PlaceOptions
  int min_gap = 10;            ///< keyframes between the two ends
  int min_shared = 15;         ///< points in common that make keyframes neighbours, so not a loop
  int strong_edge = 60;        ///< points in common from which neighbours hold together in the pose graph
  int strong_edges = 5;        ///< of those per keyframe, beside the one to its predecessor
  // Rooms repeat themselves: what would need more drift than tracking can have is another place.
  double drift_floor = 0.10;       ///< [m]
  double drift_per_metre = 0.05;   ///< of the way between the ends
  double drift_per_radian = 0.05;  ///< metres per turn of the camera between them
  double turn_floor = 0.05;        ///< [rad]
  double turn_per_radian = 0.03;
  double translation_sigma = 0.006;  ///< of neighbours' relative poses [m]
  double rotation_sigma = 0.003;     ///< [rad]
  double loop_sigma_factor = 2.0;    ///< a loop's points are not as independent as their noise
};

/// A loop that was closed.
struct LoopClosing {
  int keyframe = 0, seen_again = 0;  ///< ids of its two ends
  int inliers = 0, merged = 0;       ///< points that prove it, points that became one
  SE3<double> D;                     ///< of the newest keyframe: new T_c_w = old T_c_w D
};

/// Finds that a keyframe shows a place of long ago, spreads the drift between over all keyframes (pose
/// graph), moves the points along and makes one of those that were mapped twice.
///
/// It runs on the tracking thread, once per keyframe: a query costs about a millisecond, and only what
/// many descriptors agree on is looked at closer. So every run closes the same loops at the same frames.
class LoopCloser {
 public:
  LoopCloser(const CameraConfig& camera, const DepthNoise<double>& noise, const LoopOptions& options);

  /// @param keyframe  the newest one, in the map and not yet in the index
  /// @param depth     its depth image, CV_32FC1 [m]
  [[nodiscard]] std::optional<LoopClosing> close(LocalMap& map, PlaceIndex& index, int keyframe,
                                                 const cv::Mat& depth);

  /// Loops so far, as edges of the pose graph.
  [[nodiscard]] const std::vector<PoseGraphEdge<double>>& loops() const { return loops_; }

 private:
  /// Whether tracking can have drifted by what the pose T_c_w of keyframe `to` says.
  [[nodiscard]] bool plausible(const LocalMap& map, int from, int to, const SE3<double>& T_c_w) const;
  void correct(LocalMap& map, const PoseGraphEdge<double>& loop);
  int merge_duplicates(LocalMap& map, int keyframe, int seen_again,
                       const std::vector<std::pair<int, int>>& matches);

  CameraConfig camera_;
  LoopOptions options_;
  PlaceVerifier verifier_;
  std::vector<PoseGraphEdge<double>> loops_;
  std::vector<std::pair<int, int>> candidates_, neighbours_, around_;
};

}  // namespace dynslam::runtime
