// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/local_bundle.hpp"

#include <algorithm>
#include <span>
#include <utility>

#include "dynslam/robust/t_distribution.hpp"
#include "slam/thread_priority.hpp"

namespace dynslam::runtime {

void LocalBundle::collect(const LocalMap& map, const DepthNoise<double>& noise, int window_size) {
  const auto& keyframes = map.keyframes();
  const auto& all_points = map.points();
  newest_ = static_cast<int>(keyframes.size()) - 1;
  point_count_ = all_points.size();

  // The most votes first; ties go to the newer.
  const auto best = [&](int count, auto&& eligible) {
    std::vector<int> order;
    for (int k = 0; k <= newest_; ++k) {
      if (votes_[static_cast<std::size_t>(k)] > 0 && eligible(k)) order.push_back(k);
    }
    std::sort(order.begin(), order.end(), [&](int a, int b) {
      return std::pair(votes_[static_cast<std::size_t>(a)], a) >
             std::pair(votes_[static_cast<std::size_t>(b)], b);
    });
    if (static_cast<int>(order.size()) > count) order.resize(static_cast<std::size_t>(count));
    return order;
  };
  const auto vote = [&](int keyframe) {
    for (const int p : keyframes[static_cast<std::size_t>(keyframe)].frame.point) {
      if (p < 0 || all_points[static_cast<std::size_t>(p)].bad) continue;
      for (const int k : all_points[static_cast<std::size_t>(p)].keyframes)
        ++votes_[static_cast<std::size_t>(k)];
    }
  };
  votes_.assign(keyframes.size(), 0);
  vote(newest_);
  keyframe_ids_ = best((window_size > 0 ? window_size : options_.window) - 1,
                       [&](int k) { return k != newest_ && k != 0; });
  if (newest_ != 0) keyframe_ids_.push_back(newest_);
  const std::size_t window = keyframe_ids_.size();
  votes_.assign(keyframes.size(), 0);
  for (std::size_t i = 0; i < window; ++i) vote(keyframe_ids_[i]);
  const auto outside = best(options_.fixed, [&](int k) {
    return std::find(keyframe_ids_.begin(), keyframe_ids_.end(), k) == keyframe_ids_.end();
  });
  keyframe_ids_.insert(keyframe_ids_.end(), outside.begin(), outside.end());

  poses_.clear();
  fixed_.clear();
  for (std::size_t i = 0; i < keyframe_ids_.size(); ++i) {
    poses_.push_back(keyframes[static_cast<std::size_t>(keyframe_ids_[i])].frame.T_c_w);
    fixed_.push_back(i < window ? 0 : 1);
  }
  if (outside.empty() && window > 1) fixed_[0] = 1;  // the gauge

  // Points of the window with enough sights among these keyframes, in the order of their ids.
  std::vector<int>& sights_of = local_point_;
  sights_of.assign(all_points.size(), 0);
  for (std::size_t i = 0; i < keyframe_ids_.size(); ++i) {
    for (const int p : keyframes[static_cast<std::size_t>(keyframe_ids_[i])].frame.point) {
      if (p < 0 || all_points[static_cast<std::size_t>(p)].bad) continue;
      if (i < window || sights_of[static_cast<std::size_t>(p)] > 0) ++sights_of[static_cast<std::size_t>(p)];
    }
  }
  point_ids_.clear();
  points_.clear();
  std::size_t total = 0;
  std::vector<std::size_t> first;
  for (std::size_t p = 0; p < all_points.size(); ++p) {
    if (sights_of[p] < options_.min_sights) {
      sights_of[p] = -1;
      continue;
    }
    first.push_back(total);
    total += static_cast<std::size_t>(sights_of[p]);
    sights_of[p] = static_cast<int>(point_ids_.size());
    point_ids_.push_back(static_cast<int>(p));
    points_.push_back(all_points[p].p_w);
  }
  observations_.resize(total);
  sights_.resize(total);
  for (std::size_t i = 0; i < keyframe_ids_.size(); ++i) {
    const Frame& frame = keyframes[static_cast<std::size_t>(keyframe_ids_[i])].frame;
    for (std::size_t f = 0; f < frame.point.size(); ++f) {
      if (frame.point[f] < 0) continue;
      const int j = local_point_[static_cast<std::size_t>(frame.point[f])];
      if (j < 0) continue;
      const std::size_t at = first[static_cast<std::size_t>(j)]++;
      const Feature& feature = frame.features[f];
      const PoseObservation<double> o =
          observe(feature, all_points[static_cast<std::size_t>(frame.point[f])].p_w, noise);
      observations_[at] = {static_cast<int>(i), j, o.x, o.depth, o.inv_sigma_px2, o.inv_sigma_z2};
      sights_[at] = {keyframe_ids_[i], static_cast<int>(f)};
    }
  }
}

void LocalBundle::start(const LocalMap& map, const DepthNoise<double>& noise, int window) {
  collect(map, noise, window);
  running_ = std::async(std::launch::async, [this] {
    step_back(StepBack::some);
    return bundle_adjust<double>(camera_, problem(), options_.solver, TDistribution<double>(options_.nu),
                                 workspace_);
  });
}

SE3<double> LocalBundle::apply(LocalMap& map) {
  const BundleResult<double> result = running_.get();
  if (!result.ok()) return SE3<double>();
  Keyframe& newest = map.keyframe(newest_);
  const SE3<double> before = newest.frame.T_c_w;
  for (std::size_t i = 0; i < keyframe_ids_.size(); ++i)
    map.keyframe(keyframe_ids_[i]).frame.T_c_w = poses_[i];
  for (std::size_t j = 0; j < point_ids_.size(); ++j) map.point(point_ids_[j]).p_w = points_[j];
  for (std::size_t k = 0; k < observations_.size(); ++k) {
    const auto& o = observations_[k];
    if (bundle_chi2<double>(camera_, poses_[static_cast<std::size_t>(o.pose)],
                            points_[static_cast<std::size_t>(o.point)], o) > options_.outlier_chi2) {
      map.forget(sights_[k].keyframe, sights_[k].feature);
    }
  }
  const SE3<double> D = before.inverse() * newest.frame.T_c_w;
  const SE3<double> D_inverse = D.inverse();
  for (std::size_t k = static_cast<std::size_t>(newest_) + 1; k < map.keyframes().size(); ++k) {
    SE3<double>& T = map.keyframe(static_cast<int>(k)).frame.T_c_w;
    T = T * D;
  }
  for (std::size_t p = point_count_; p < map.points().size(); ++p) {
    map.points()[p].p_w = D_inverse * map.points()[p].p_w;
  }
  return D;
}

}  // namespace dynslam::runtime
