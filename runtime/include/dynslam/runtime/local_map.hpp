// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "dynslam/runtime/frame.hpp"
#include "dynslam/runtime/patch_matcher.hpp"

namespace dynslam::runtime {

/// A landmark, made from the depth of the keyframe that first saw it and refined by later ones.
struct MapPoint {
  Eigen::Vector3d p_w = Eigen::Vector3d::Zero();
  Eigen::Vector3d viewing = Eigen::Vector3d::Zero();  ///< mean unit direction from camera to point
  Descriptor descriptor{};
  PointPatch patch;
  double information = 0;        ///< sum of the inverse depth variances that formed p_w [1/m^2]
  float reference_distance = 0;  ///< metres at creation
  int reference_octave = 0;
  int visible = 0, found = 0;  ///< frames in which it should have been / was matched
  int on_mover = 0;            ///< frames in which its match lay on the dynamic mask
  bool bad = false;
  std::vector<int> keyframes;  ///< observers
};

/// A keyframe: the frame's features and the map points they observe.
struct Keyframe {
  int id = 0;
  Frame frame;
};

/// Keyframes and points, with the covisibility query that tracking needs.
class LocalMap {
 public:
  [[nodiscard]] std::vector<MapPoint>& points() { return points_; }
  [[nodiscard]] const std::vector<MapPoint>& points() const { return points_; }
  [[nodiscard]] const std::vector<Keyframe>& keyframes() const { return keyframes_; }
  [[nodiscard]] MapPoint& point(int id) { return points_[static_cast<std::size_t>(id)]; }

  [[nodiscard]] Keyframe& keyframe(int id) { return keyframes_[static_cast<std::size_t>(id)]; }

  /// Adds a point and returns its id.
  int add_point(MapPoint point);
  /// Adds a keyframe (its observations are registered with the points) and returns its id.
  int add_keyframe(const Frame& frame);

  /// Ids of the points of the `count` keyframes that share most points with `frame` (ties: newer
  /// first), of their temporal neighbours and of the newest keyframe; each id once.
  void local_points(const Frame& frame, int count, std::vector<int>& ids);

  /// Takes back that a keyframe's feature shows the point it is said to; points that nobody sees are bad.
  void forget(int keyframe, int feature);

  /// Marks points that are seldom found where they should be.
  void cull();

 private:
  std::vector<MapPoint> points_;
  std::vector<Keyframe> keyframes_;
  std::vector<int> votes_, order_;
  std::vector<std::uint32_t> stamp_;
  std::uint32_t present_ = 0;
};

}  // namespace dynslam::runtime
