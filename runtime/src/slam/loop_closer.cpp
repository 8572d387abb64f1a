// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/loop_closer.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "dynslam/robust/kernels.hpp"

namespace dynslam::runtime {
namespace {

constexpr double kLoopFloor = 5e-4;  // standard deviation of a loop edge, however many points [m, rad]
constexpr int kSameCorner = 60;      // Hamming distance of two views of one corner where the geometry agrees

PlaceOptions place_options(const LoopOptions& options) {
  PlaceOptions place;
  place.min_inliers = options.min_inliers;
  place.min_agreement = options.min_agreement;
  return place;
}

}  // namespace

LoopCloser::LoopCloser(const CameraConfig& camera, const DepthNoise<double>& noise,
                       const LoopOptions& options)
    : camera_(camera), options_(options), verifier_(camera, noise, place_options(options)) {}

std::optional<LoopClosing> LoopCloser::close(LocalMap& map, PlaceIndex& index, int keyframe,
                                             const cv::Mat& depth) {
  if (keyframe < options_.min_gap) return std::nullopt;
  index.query(map.keyframe(keyframe).frame, candidates_);
  map.covisible(keyframe, options_.min_shared, neighbours_);
  int tried = 0;
  for (const auto& [votes, candidate] : candidates_) {
    if (votes < options_.min_votes || tried == options_.candidates) break;
    const bool known = std::any_of(neighbours_.begin(), neighbours_.end(),
                                   [c = candidate](const auto& n) { return n.second == c; });
    if (known || keyframe - candidate < options_.min_gap) continue;
    ++tried;
    const auto found = verifier_.verify(map, map.keyframe(keyframe).frame, depth, candidate);
    if (!found || !plausible(map, candidate, keyframe, found->T_c_w)) continue;

    LoopClosing closing;
    closing.keyframe = keyframe;
    closing.seen_again = candidate;
    closing.inliers = static_cast<int>(found->matches.size());
    PoseGraphEdge<double> loop;
    loop.i = candidate;
    loop.j = keyframe;
    loop.T_j_i = found->T_c_w * map.keyframe(candidate).frame.T_c_w.inverse();
    // A narrow overlap tells some directions badly, and the chain may know better.
    Eigen::Matrix<double, 6, 6> covariance =
        options_.loop_sigma_factor * options_.loop_sigma_factor * found->covariance;
    covariance.diagonal().array() += kLoopFloor * kLoopFloor;
    loop.information = covariance.inverse();
    const SE3<double> before = map.keyframe(keyframe).frame.T_c_w;
    correct(map, loop);
    loops_.push_back(loop);
    closing.merged = merge_duplicates(map, keyframe, candidate, found->matches);
    closing.D = before.inverse() * map.keyframe(keyframe).frame.T_c_w;
    return closing;
  }
  return std::nullopt;
}

bool LoopCloser::plausible(const LocalMap& map, int from, int to, const SE3<double>& T_c_w) const {
  double travelled = 0, turned = 0;
  SE3<double> last = map.pose(from);
  for (int k = from + 1; k <= to; ++k) {
    const SE3<double> next = map.pose(k), motion = next * last.inverse();
    travelled += motion.translation().norm();
    turned += motion.so3().log().norm();
    last = next;
  }
  // Seen from the new end, so that the turn does not count twice by its lever.
  const SE3<double> drift = T_c_w * map.keyframe(to).frame.T_c_w.inverse();
  return drift.translation().norm() < options_.drift_floor + options_.drift_per_metre * travelled +
                                          options_.drift_per_radian * turned &&
         drift.so3().log().norm() < options_.turn_floor + options_.turn_per_radian * turned;
}

void LoopCloser::correct(LocalMap& map, const PoseGraphEdge<double>& loop) {
  const int count = static_cast<int>(map.keyframes().size());
  Eigen::Matrix<double, 6, 1> sigma;
  sigma << Eigen::Vector3d::Constant(options_.translation_sigma),
      Eigen::Vector3d::Constant(options_.rotation_sigma);
  const Eigen::Matrix<double, 6, 6> information = sigma.cwiseProduct(sigma).cwiseInverse().asDiagonal();

  std::vector<SE3<double>> poses;
  std::vector<std::uint8_t> fixed(static_cast<std::size_t>(count), 0);
  std::vector<PoseGraphEdge<double>> edges;
  const auto add = [&](int i, int j) {
    edges.push_back({i, j, map.keyframe(j).frame.T_c_w * map.keyframe(i).frame.T_c_w.inverse(), information});
  };
  int previous = -1;
  for (int k = 0; k < count; ++k) {
    poses.push_back(map.pose(k));
    if (map.keyframe(k).culled()) {
      fixed[static_cast<std::size_t>(k)] = 1;  // follows its parent
      continue;
    }
    if (previous >= 0) add(previous, k);
    map.covisible(k, options_.strong_edge, around_);
    int taken = 0;
    for (const auto& [shared, other] : around_) {
      if (other >= k || other == previous) continue;  // each pair once
      if (taken++ == options_.strong_edges) break;
      add(other, k);
    }
    previous = k;
  }
  fixed[0] = 1;
  for (PoseGraphEdge<double> e : loops_) {  // of culled ends the parents hold it
    for (; map.keyframe(e.i).culled(); e.i = map.keyframe(e.i).parent)
      e.T_j_i = e.T_j_i * map.keyframe(e.i).T_c_parent;
    for (; map.keyframe(e.j).culled(); e.j = map.keyframe(e.j).parent)
      e.T_j_i = map.keyframe(e.j).T_c_parent.inverse() * e.T_j_i;
    if (e.i != e.j) edges.push_back(e);
  }
  edges.push_back(loop);
  (void)optimize_pose_graph<double>({poses, fixed, edges}, PoseGraphOptions<double>{}, SquaredLoss<double>{});

  // A point stays where its oldest observer sees it.
  std::vector<SE3<double>> moves(static_cast<std::size_t>(count));
  for (int k = 0; k < count; ++k) {
    const auto i = static_cast<std::size_t>(k);
    if (!map.keyframe(k).culled()) moves[i] = poses[i].inverse() * map.keyframe(k).frame.T_c_w;
  }
  for (MapPoint& p : map.points()) {
    if (!p.bad && !p.keyframes.empty()) p.p_w = moves[static_cast<std::size_t>(p.keyframes.front())] * p.p_w;
  }
  for (int k = 0; k < count; ++k) {
    if (!map.keyframe(k).culled()) map.keyframe(k).frame.T_c_w = poses[static_cast<std::size_t>(k)];
  }
}

int LoopCloser::merge_duplicates(LocalMap& map, int keyframe, int seen_again,
                                 const std::vector<std::pair<int, int>>& matches) {
  int merged = 0;
  const auto join = [&](int k, int feature, int id) {
    const int present = map.keyframe(k).frame.point[static_cast<std::size_t>(feature)];
    if (present == id) return;
    const auto& observers = map.point(id).keyframes;
    const bool seen = std::find(observers.begin(), observers.end(), k) != observers.end();
    if (present >= 0) {
      if (seen) return;  // two corners beside each other, not one
      map.merge(present, id);
      ++merged;
    } else if (!seen) {
      map.observe(k, feature, id);
    }
  };
  for (const auto& [feature, id] : matches) {
    if (!map.point(id).bad) join(keyframe, feature, id);
  }
  // The neighbours of the new end saw the same place a moment ago.
  std::vector<int> points;
  map.covisible(seen_again, options_.min_shared, around_);
  if (around_.size() > 5) around_.resize(5);
  around_.insert(around_.begin(), {0, seen_again});
  for (const auto& [shared, k] : around_) {
    for (const int id : map.keyframe(k).frame.point) {
      if (id >= 0 && !map.point(id).bad) points.push_back(id);
    }
  }
  std::sort(points.begin(), points.end());
  points.erase(std::unique(points.begin(), points.end()), points.end());
  map.covisible(keyframe, options_.min_shared, neighbours_);
  if (neighbours_.size() > 10) neighbours_.resize(10);
  for (const auto& [shared, k] : neighbours_) {
    if (std::any_of(around_.begin(), around_.end(), [k = k](const auto& n) { return n.second == k; }))
      continue;
    const Frame& frame = map.keyframe(k).frame;
    for (const int id : points) {
      const MapPoint& p = map.point(id);
      if (p.bad || std::find(p.keyframes.begin(), p.keyframes.end(), k) != p.keyframes.end()) continue;
      const Eigen::Vector3d p_c = frame.T_c_w * p.p_w;
      const auto x = camera_.model.pinhole().project(p_c);
      if (!x) continue;
      int best = -1, distance = kSameCorner + 1;
      frame.grid.for_each_near(
          frame.features, static_cast<float>(x->x()), static_cast<float>(x->y()), 6.0F, [&](int i) {
            const auto at = static_cast<std::size_t>(i);
            const Feature& f = frame.features[at];
            if (frame.dynamic[at] != 0 ||
                (f.depth > 0 && std::abs(static_cast<double>(f.depth) - p_c.z()) > 0.05 * p_c.z()))
              return;
            const int d = hamming_distance(p.descriptor, frame.descriptors[at]);
            if (d < distance) {
              distance = d;
              best = i;
            }
          });
      if (best >= 0) join(k, best, id);
    }
  }
  return merged;
}

}  // namespace dynslam::runtime
