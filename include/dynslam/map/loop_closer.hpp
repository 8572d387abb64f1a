// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/concepts/image.hpp"
#include "dynslam/features/guided_match.hpp"
#include "dynslam/features/place_index.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/geometry/small_cholesky.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/map/keyframe_map.hpp"
#include "dynslam/map/place_verifier.hpp"
#include "dynslam/optim/pose_graph.hpp"
#include "dynslam/robust/kernels.hpp"

namespace dynslam {

/// When LoopCloser closes a loop.
template <std::floating_point S = double>
struct LoopOptions {
  int min_votes = 25;        ///< descriptors in common from which geometry is asked
  int candidates = 3;        ///< keyframes that geometry is asked about
  int min_inliers = 60;      ///< points that fit one pose: a false loop costs more than a missed one
  S min_agreement = S(0.8);  ///< of depths, see PlaceOptions
  int min_gap = 10;          ///< keyframes between the two ends
  int min_shared = 15;       ///< points in common that make keyframes neighbours, so not a loop
  int strong_edge = 60;      ///< points in common from which neighbours hold together in the pose graph
  int strong_edges = 5;      ///< of those per keyframe, beside the one to its predecessor
  // Rooms repeat themselves: what would need more drift than tracking can have is another place.
  S drift_floor = S(0.10);       ///< [m]
  S drift_per_metre = S(0.05);   ///< of the way between the ends
  S drift_per_radian = S(0.05);  ///< metres per turn of the camera between them
  S turn_floor = S(0.05);        ///< [rad]
  S turn_per_radian = S(0.03);
  S translation_sigma = S(0.006);  ///< of neighbours' relative poses [m]
  S rotation_sigma = S(0.003);     ///< [rad]
  S loop_sigma_factor = S(2);      ///< a loop's points are not as independent as their noise
  S loop_sigma_floor = S(5e-4);    ///< standard deviation of a loop, however many points prove it [m, rad]
  // Points that were mapped twice are looked for in the surroundings of both ends.
  int merge_old = 5;        ///< neighbours of the old end whose points are searched
  int merge_new = 10;       ///< neighbours of the new end in which they are
  float merge_radius = 6;   ///< half side of the search [px]
  int merge_distance = 60;  ///< Hamming distance of two views of one corner where the geometry agrees
  S merge_depth = S(0.05);  ///< share of the distance by which its depth may differ
};

/// A loop that was closed.
template <std::floating_point S = double>
struct LoopClosing {
  int keyframe = 0, seen_again = 0;  ///< ids of its two ends
  int inliers = 0, merged = 0;       ///< points that prove it, points that became one
  SE3<S> D;                          ///< of the newest keyframe: new T_c_w = old T_c_w D
};

/// The surroundings of a keyframe as the pose graph has them: edges to its predecessor and to the keyframes
/// that share most points with it, with the relative poses of now; culled keyframes are fixed, their poses
/// hang on others.
template <std::floating_point S, class Patch>
void covisibility_graph(KeyframeMap<S, Patch>& map, const LoopOptions<S>& options, std::vector<SE3<S>>& poses,
                        std::vector<std::uint8_t>& fixed, std::vector<PoseGraphEdge<S>>& edges) {
  const int count = map.newest() + 1;
  Eigen::Matrix<S, 6, 1> sigma;
  sigma << Eigen::Matrix<S, 3, 1>::Constant(options.translation_sigma),
      Eigen::Matrix<S, 3, 1>::Constant(options.rotation_sigma);
  const Eigen::Matrix<S, 6, 6> information = sigma.cwiseProduct(sigma).cwiseInverse().asDiagonal();
  const auto add = [&](int i, int j) {
    edges.push_back({i, j, map.keyframe(j).frame.T_c_w * map.keyframe(i).frame.T_c_w.inverse(), information});
  };
  poses.clear();
  fixed.assign(static_cast<std::size_t>(count), 0);
  edges.clear();
  std::vector<std::pair<int, int>> around;
  int previous = -1;
  for (int k = 0; k < count; ++k) {
    poses.push_back(map.pose(k));
    if (map.keyframe(k).culled()) {
      fixed[static_cast<std::size_t>(k)] = 1;  // follows its parent
      continue;
    }
    if (previous >= 0) add(previous, k);
    map.covisible(k, options.strong_edge, around);
    int taken = 0;
    for (const auto& [shared, other] : around) {
      if (other >= k || other == previous) continue;  // each pair once
      if (taken++ == options.strong_edges) break;
      add(other, k);
    }
    previous = k;
  }
}

/// An edge between keyframes that may have been culled since, as one between those that hold their poses.
template <std::floating_point S, class Patch>
[[nodiscard]] PoseGraphEdge<S> edge_of_parents(const KeyframeMap<S, Patch>& map, PoseGraphEdge<S> e) {
  for (; map.keyframe(e.i).culled(); e.i = map.keyframe(e.i).parent)
    e.T_j_i = e.T_j_i * map.keyframe(e.i).T_c_parent;
  for (; map.keyframe(e.j).culled(); e.j = map.keyframe(e.j).parent)
    e.T_j_i = map.keyframe(e.j).T_c_parent.inverse() * e.T_j_i;
  return e;
}

/// Gives the keyframes new poses, T_c_w by id. A point stays where its oldest observer sees it.
template <std::floating_point S, class Patch>
void move_keyframes(KeyframeMap<S, Patch>& map, std::span<const SE3<S>> poses) {
  std::vector<SE3<S>> moves(poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const auto& k = map.keyframes()[i];
    if (!k.culled()) moves[i] = poses[i].inverse() * k.frame.T_c_w;
  }
  for (auto& p : map.points()) {
    if (!p.bad && !p.keyframes.empty()) p.p_w = moves[static_cast<std::size_t>(p.keyframes.front())] * p.p_w;
  }
  for (std::size_t i = 0; i < poses.size(); ++i) {
    auto& k = map.keyframe(static_cast<int>(i));
    if (!k.culled()) k.frame.T_c_w = poses[i];
  }
}

/// Finds that a keyframe shows a place of long ago, spreads the drift between over all keyframes (pose
/// graph), moves the points along and makes one of those that were mapped twice.
///
/// Meant to run once per keyframe, on the thread that tracks: a query costs about a millisecond, and only
/// what many descriptors agree on is looked at closer. So every run closes the same loops at the same frames.
/// @tparam Camera, ImageCamera  see PlaceVerifier
template <DifferentiableCamera Camera, CameraModel ImageCamera = Camera>
class LoopCloser {
 public:
  using S = typename Camera::ScalarType;

  LoopCloser(const Camera& camera, const ImageCamera& image_camera, const DepthNoise<S>& noise,
             const LoopOptions<S>& options = {})
      : camera_(camera), options_(options), verifier_(camera, image_camera, noise, place_options(options)) {}

  /// @param keyframe  the newest one, in the map and not yet in the index
  /// @param depth     its depth image [m]
  /// @return nullopt where it shows no place again, with nothing changed
  template <class Patch, DepthImage Depth>
  [[nodiscard]] std::optional<LoopClosing<S>> close(KeyframeMap<S, Patch>& map, PlaceIndex& index,
                                                    int keyframe, const Depth& depth) {
    if (keyframe < options_.min_gap) return std::nullopt;
    const FeatureFrame<S>& frame = map.keyframe(keyframe).frame;
    index.query(frame, candidates_);
    map.covisible(keyframe, options_.min_shared, neighbours_);
    int tried = 0;
    for (const auto& [votes, candidate] : candidates_) {
      if (votes < options_.min_votes || tried == options_.candidates) break;
      const bool known = std::any_of(neighbours_.begin(), neighbours_.end(),
                                     [c = candidate](const auto& n) { return n.second == c; });
      if (known || keyframe - candidate < options_.min_gap) continue;
      ++tried;
      const PlaceResult<S> place = verifier_.verify(map, frame, depth, candidate);
      if (!place.ok() || !plausible(map, candidate, keyframe, place.T_c_w)) continue;
      const SE3<S> before = frame.T_c_w;
      if (!correct(map, edge_of(map, candidate, keyframe, place))) continue;
      LoopClosing<S> closing;
      closing.keyframe = keyframe;
      closing.seen_again = candidate;
      closing.inliers = static_cast<int>(place.matches.size());
      closing.merged = merge_duplicates(map, keyframe, candidate, place.matches);
      closing.D = before.inverse() * frame.T_c_w;
      return closing;
    }
    return std::nullopt;
  }

  /// Loops so far, as edges of the pose graph.
  [[nodiscard]] const std::vector<PoseGraphEdge<S>>& loops() const { return loops_; }

 private:
  using Matrix6 = Eigen::Matrix<S, 6, 6>;

  static PlaceOptions<S> place_options(const LoopOptions<S>& options) {
    PlaceOptions<S> place;
    place.min_inliers = options.min_inliers;
    place.min_agreement = options.min_agreement;
    return place;
  }

  /// Whether tracking can have drifted by what the pose T_c_w of keyframe `to` says.
  template <class Patch>
  [[nodiscard]] bool plausible(const KeyframeMap<S, Patch>& map, int from, int to,
                               const SE3<S>& T_c_w) const {
    S travelled = 0, turned = 0;
    SE3<S> last = map.pose(from);
    for (int k = from + 1; k <= to; ++k) {
      const SE3<S> next = map.pose(k), motion = next * last.inverse();
      travelled += motion.translation().norm();
      turned += motion.so3().log().norm();
      last = next;
    }
    // Seen from the new end, so that the turn does not count twice by its lever.
    const SE3<S> drift = T_c_w * map.keyframe(to).frame.T_c_w.inverse();
    return drift.translation().norm() < options_.drift_floor + options_.drift_per_metre * travelled +
                                            options_.drift_per_radian * turned &&
           drift.so3().log().norm() < options_.turn_floor + options_.turn_per_radian * turned;
  }

  template <class Patch>
  [[nodiscard]] PoseGraphEdge<S> edge_of(const KeyframeMap<S, Patch>& map, int candidate, int keyframe,
                                         const PlaceResult<S>& place) const {
    PoseGraphEdge<S> loop;
    loop.i = candidate;
    loop.j = keyframe;
    loop.T_j_i = place.T_c_w * map.keyframe(candidate).frame.T_c_w.inverse();
    // A narrow overlap tells some directions badly, and the chain may know better.
    Matrix6 covariance = options_.loop_sigma_factor * options_.loop_sigma_factor * place.covariance;
    covariance.diagonal().array() += options_.loop_sigma_floor * options_.loop_sigma_floor;
    SmallCholesky<S, 6> factor;
    if (factor.compute(covariance)) loop.information = factor.inverse();
    return loop;
  }

  /// Closes the loop in the pose graph. @return false, with nothing changed, where that has no solution
  template <class Patch>
  [[nodiscard]] bool correct(KeyframeMap<S, Patch>& map, const PoseGraphEdge<S>& loop) {
    covisibility_graph(map, options_, poses_, fixed_, edges_);
    fixed_[0] = 1;
    for (const PoseGraphEdge<S>& known : loops_) {
      const PoseGraphEdge<S> e = edge_of_parents(map, known);
      if (e.i != e.j) edges_.push_back(e);
    }
    edges_.push_back(loop);
    const auto result =
        optimize_pose_graph(PoseGraph<S>{poses_, fixed_, edges_}, PoseGraphOptions<S>{}, SquaredLoss<S>{});
    if (!result.ok()) return false;
    move_keyframes(map, std::span<const SE3<S>>(poses_));
    loops_.push_back(loop);
    return true;
  }

  /// Makes one point of those that the two ends show both. @return how many are gone
  template <class Patch>
  int merge_duplicates(KeyframeMap<S, Patch>& map, int keyframe, int seen_again,
                       const std::vector<std::pair<int, int>>& matches) {
    int merged = 0;
    for (const auto& [feature, id] : matches) {
      if (!map.point(id).bad) merged += join(map, keyframe, feature, id);
    }
    // The neighbours of the new end saw the same place a moment ago.
    map.covisible(seen_again, options_.min_shared, around_, options_.merge_old);
    around_.insert(around_.begin(), {0, seen_again});
    points_.clear();
    for (const auto& [shared, k] : around_) {
      for (const int id : map.keyframe(k).frame.point) {
        if (id >= 0 && !map.point(id).bad) points_.push_back(id);
      }
    }
    std::sort(points_.begin(), points_.end());
    points_.erase(std::unique(points_.begin(), points_.end()), points_.end());
    map.covisible(keyframe, options_.min_shared, neighbours_, options_.merge_new);
    for (const auto& [shared, k] : neighbours_) {
      if (std::none_of(around_.begin(), around_.end(), [one = k](const auto& n) { return n.second == one; }))
        merged += merge_into(map, k);
    }
    return merged;
  }

  /// Looks for points_ in a keyframe.
  template <class Patch>
  int merge_into(KeyframeMap<S, Patch>& map, int keyframe) {
    int merged = 0;
    const FeatureFrame<S>& frame = map.keyframe(keyframe).frame;
    GuidedQuery query;
    query.radius = options_.merge_radius;
    query.max_distance = options_.merge_distance;
    for (const int id : points_) {
      const auto& p = map.point(id);
      if (p.bad || sees(p.keyframes, keyframe)) continue;
      const Eigen::Matrix<S, 3, 1> p_c = frame.T_c_w * p.p_w;
      const auto x = camera_.project(p_c);
      if (!x) continue;
      query.x = static_cast<float>(x->x());
      query.y = static_cast<float>(x->y());
      const GuidedMatch match = guided_match(frame.view(), p.descriptor, query, [&](int i) {
        const Feature& f = frame.features[static_cast<std::size_t>(i)];
        return !(f.depth > 0 && std::abs(static_cast<S>(f.depth) - p_c.z()) > options_.merge_depth * p_c.z());
      });
      if (match.ok()) merged += join(map, keyframe, match.feature, id);
    }
    return merged;
  }

  /// Has a feature show a point. @return 1 where another one had to go for it
  template <class Patch>
  static int join(KeyframeMap<S, Patch>& map, int keyframe, int feature, int id) {
    const int present = map.keyframe(keyframe).frame.point[static_cast<std::size_t>(feature)];
    if (present == id) return 0;
    const bool seen = sees(map.point(id).keyframes, keyframe);
    if (present < 0) {
      if (!seen) map.observe(keyframe, feature, id);
      return 0;
    }
    if (seen) return 0;  // two corners beside each other, not one
    map.merge(present, id);
    return 1;
  }

  [[nodiscard]] static bool sees(const std::vector<int>& observers, int keyframe) {
    return std::find(observers.begin(), observers.end(), keyframe) != observers.end();
  }

  Camera camera_;
  LoopOptions<S> options_;
  PlaceVerifier<Camera, ImageCamera> verifier_;
  std::vector<PoseGraphEdge<S>> loops_, edges_;
  std::vector<SE3<S>> poses_;
  std::vector<std::uint8_t> fixed_;
  std::vector<int> points_;
  std::vector<std::pair<int, int>> candidates_, neighbours_, around_;
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
