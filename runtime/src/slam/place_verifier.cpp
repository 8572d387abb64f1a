// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/place_verifier.hpp"

#include <algorithm>
#include <cstddef>
#include <span>

#include "dynslam/robust/t_distribution.hpp"

namespace dynslam::runtime {
namespace {

constexpr int kClose = 60;       // Hamming distance of a match by descriptor alone
constexpr int kExpected = 80;    // and of one where the geometry limits the search
constexpr float kRadius = 6.0F;  // of that search, in standard deviations of a corner

}  // namespace

void PlaceVerifier::propose(const LocalMap& map, const Frame& frame, const Frame& keyframe) {
  matches_.clear();
  distance_of_feature_.assign(frame.features.size(), 257);
  for (std::size_t j = 0; j < keyframe.features.size(); ++j) {
    const int id = keyframe.point[j];
    if (id < 0 || map.points()[static_cast<std::size_t>(id)].bad) continue;
    int best = -1, distance = 257, second = 257;
    for (std::size_t i = 0; i < frame.features.size(); ++i) {
      if (frame.dynamic[i] != 0) continue;
      const int d = hamming_distance(keyframe.descriptors[j], frame.descriptors[i]);
      if (d < distance) {
        second = distance;
        distance = d;
        best = static_cast<int>(i);
      } else if (d < second) {
        second = d;
      }
    }
    if (best < 0 || distance > kClose || 10 * distance > 9 * second) continue;
    if (distance >= distance_of_feature_[static_cast<std::size_t>(best)]) continue;
    std::erase_if(matches_, [&](const auto& m) { return m.first == best; });
    distance_of_feature_[static_cast<std::size_t>(best)] = distance;
    matches_.emplace_back(best, id);
  }
}

void PlaceVerifier::search(LocalMap& map, const Frame& frame, int keyframe, const SE3<double>& T_c_w) {
  map.covisible(keyframe, 15, around_);
  if (static_cast<int>(around_.size()) > options_.neighbours)
    around_.resize(static_cast<std::size_t>(options_.neighbours));
  around_.insert(around_.begin(), {0, keyframe});
  matches_.clear();
  searched_.clear();
  distance_of_feature_.assign(frame.features.size(), 257);
  point_of_feature_.assign(frame.features.size(), -1);
  tried_.assign(map.points().size(), 0);
  for (const auto& [shared, k] : around_) {
    const Frame& near = map.keyframe(k).frame;
    for (const int id : near.point) {
      if (id < 0 || tried_[static_cast<std::size_t>(id)] != 0 || map.point(id).bad) continue;
      tried_[static_cast<std::size_t>(id)] = 1;
      searched_.push_back(id);
      const MapPoint& p = map.point(id);
      const auto x = camera_.model.pinhole().project(T_c_w * p.p_w);
      if (!x) continue;
      int best = -1, distance = kExpected + 1;
      // The corner may be of any scale: its own accuracy says how far off it may lie.
      frame.grid.for_each_near(
          frame.features, static_cast<float>(x->x()), static_cast<float>(x->y()), 4 * kRadius, [&](int i) {
            const Feature& f = frame.features[static_cast<std::size_t>(i)];
            if (frame.dynamic[static_cast<std::size_t>(i)] != 0) return;
            const float reach = kRadius * std::clamp(f.sigma, 1.0F, 4.0F);
            if (std::abs(f.x - static_cast<float>(x->x())) > reach ||
                std::abs(f.y - static_cast<float>(x->y())) > reach)
              return;
            const int d = hamming_distance(p.descriptor, frame.descriptors[static_cast<std::size_t>(i)]);
            if (d < distance) {
              distance = d;
              best = i;
            }
          });
      if (best < 0 || distance >= distance_of_feature_[static_cast<std::size_t>(best)]) continue;
      distance_of_feature_[static_cast<std::size_t>(best)] = distance;
      point_of_feature_[static_cast<std::size_t>(best)] = id;
    }
  }
  for (std::size_t i = 0; i < point_of_feature_.size(); ++i) {
    if (point_of_feature_[i] >= 0) matches_.emplace_back(static_cast<int>(i), point_of_feature_[i]);
  }
}

PoseResult<double> PlaceVerifier::refine(const LocalMap& map, const Frame& frame, const SE3<double>& start) {
  observations_.clear();
  for (const auto& [feature, id] : matches_)
    observations_.push_back(observe(frame.features[static_cast<std::size_t>(feature)],
                                    map.points()[static_cast<std::size_t>(id)].p_w, noise_));
  const PoseResult<double> result =
      optimize_pose(camera_.model.pinhole(), std::span<const PoseObservation<double>>(observations_), start,
                    PoseOptions<double>{}, TDistribution<double>(options_.nu), pose_);
  std::size_t kept = 0;
  for (std::size_t k = 0; k < matches_.size(); ++k) {
    if (pose_.inlier[k] != 0) matches_[kept++] = matches_[k];
  }
  matches_.resize(kept);
  return result;
}

double PlaceVerifier::agreement(const LocalMap& map, const cv::Mat& depth, const SE3<double>& T_c_w) const {
  constexpr double kSlack = 0.05;  // of the distance, beside three standard deviations
  int agree = 0, hidden = 0, seen_through = 0;
  for (const int id : searched_) {
    const Eigen::Vector3d p_c = T_c_w * map.points()[static_cast<std::size_t>(id)].p_w;
    const auto x = camera_.model.project(p_c);
    if (!x) continue;
    const int u = static_cast<int>(std::lround(x->x())), v = static_cast<int>(std::lround(x->y()));
    if (u < 0 || v < 0 || u >= depth.cols || v >= depth.rows) continue;
    const float z = depth.at<float>(v, u);
    if (!is_valid_depth(z)) continue;
    const double ahead = static_cast<double>(z) - p_c.z(),
                 slack = kSlack * p_c.z() + 3 * noise_.sigma(p_c.z());
    ++(ahead > slack ? seen_through : ahead < -slack ? hidden : agree);
  }
  return agree > 0 ? static_cast<double>(agree) / (agree + seen_through) : 0.0;
}

std::optional<PlaceMatch> PlaceVerifier::verify(LocalMap& map, const Frame& frame, const cv::Mat& depth,
                                                int keyframe) {
  propose(map, frame, map.keyframe(keyframe).frame);
  if (static_cast<int>(matches_.size()) < options_.min_matches) return std::nullopt;
  observations_.clear();
  for (const auto& [feature, id] : matches_)
    observations_.push_back(
        observe(frame.features[static_cast<std::size_t>(feature)], map.point(id).p_w, noise_));
  AbsolutePoseOptions<double> options;
  options.seed = options_.seed + frame.index;
  const auto start = absolute_pose<double>(camera_.model.pinhole(), observations_, options, absolute_);
  if (!start.found || start.inliers < options_.min_matches / 2) return std::nullopt;
  PoseResult<double> pose = refine(map, frame, start.T_c_w);
  for (int round = 0; round < 2; ++round) {
    search(map, frame, keyframe, pose.T_c_w);
    if (static_cast<int>(matches_.size()) < options_.min_matches) return std::nullopt;
    pose = refine(map, frame, pose.T_c_w);
  }
  if (static_cast<int>(matches_.size()) < options_.min_inliers) return std::nullopt;
  if (agreement(map, depth, pose.T_c_w) < options_.min_agreement) return std::nullopt;
  return PlaceMatch{pose.T_c_w, pose.covariance, matches_};
}

}  // namespace dynslam::runtime
