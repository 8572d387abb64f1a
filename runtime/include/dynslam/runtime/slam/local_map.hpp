// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "dynslam/runtime/slam/frame.hpp"
#include "dynslam/runtime/slam/patch_matcher.hpp"

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
  int merged_into = -1;        ///< the point that stands for this one now; -1: none (bad then means gone)
  std::vector<int> keyframes;  ///< observers, oldest first
};

/// A keyframe: the frame's features and the map points they observe.
struct Keyframe {
  int id = 0;
  Frame frame;
  int parent = -1;         ///< of a culled keyframe: the one that its pose hangs on
  SE3<double> T_c_parent;  ///< and its place beside that one
  [[nodiscard]] bool culled() const { return parent >= 0; }
};

/// Keyframes and points, with the covisibility query that tracking needs.
class LocalMap {
 public:
  LocalMap() = default;
  /// A map as it was saved; ids are positions.
  LocalMap(std::vector<Keyframe> keyframes, std::vector<MapPoint> points)
      : points_(std::move(points)), keyframes_(std::move(keyframes)) {}

  [[nodiscard]] std::vector<MapPoint>& points() { return points_; }
  [[nodiscard]] const std::vector<MapPoint>& points() const { return points_; }
  [[nodiscard]] const std::vector<Keyframe>& keyframes() const { return keyframes_; }
  [[nodiscard]] MapPoint& point(int id) { return points_[static_cast<std::size_t>(id)]; }

  [[nodiscard]] Keyframe& keyframe(int id) { return keyframes_[static_cast<std::size_t>(id)]; }
  [[nodiscard]] const Keyframe& keyframe(int id) const { return keyframes_[static_cast<std::size_t>(id)]; }

  /// Id of the newest keyframe; -1 when there is none.
  [[nodiscard]] int newest() const { return static_cast<int>(keyframes_.size()) - 1; }
  /// T_c_w of a keyframe, culled or not.
  [[nodiscard]] SE3<double> pose(int keyframe) const;
  /// The point that stands for `id` after merging; -1 when there is none any more.
  [[nodiscard]] int present(int id) const;

  /// Adds a point and returns its id.
  int add_point(MapPoint point);
  /// Adds a keyframe (its observations are registered with the points) and returns its id.
  int add_keyframe(const Frame& frame);

  /// Ids of the points of the `count` keyframes that share most points with `frame` (ties: newer
  /// first), of their temporal neighbours and of the newest keyframe; each id once.
  void local_points(const Frame& frame, int count, std::vector<int>& ids);

  /// Keyframes that share at least `min_shared` points with a keyframe: (shared points, id), most first,
  /// ties newer first.
  void covisible(int keyframe, int min_shared, std::vector<std::pair<int, int>>& out);

  /// Says that a keyframe's feature shows a point. The feature must have none yet.
  void observe(int keyframe, int feature, int point);
  /// Makes `kept` stand for `gone` too: it gets the other's observers.
  void merge(int gone, int kept);

  /// Removes a keyframe whose points `share` or more are seen by at least three others; its pose hangs
  /// on the keyframe that shares most points with it from then on. Tries those that share points with
  /// `newest`, except the first one and the last `spare`. @return the culled ids
  std::vector<int> cull_keyframes(int newest, double share, int spare);

  /// Takes back that a keyframe's feature shows the point it is said to; points that nobody sees are bad.
  void forget(int keyframe, int feature);

  /// Marks points that are seldom found where they should be.
  void cull();

 private:
  std::vector<MapPoint> points_;
  std::vector<Keyframe> keyframes_;
  std::vector<int> votes_, order_;
  std::vector<std::pair<int, int>> neighbours_;
  std::vector<std::uint32_t> stamp_;
  std::uint32_t present_ = 0;
};

}  // namespace dynslam::runtime
