// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/local_map.hpp"

#include <algorithm>
#include <functional>
#include <utility>

namespace dynslam::runtime {

int LocalMap::add_point(MapPoint point) {
  points_.push_back(std::move(point));
  return static_cast<int>(points_.size()) - 1;
}

int LocalMap::add_keyframe(const Frame& frame) {
  const int id = static_cast<int>(keyframes_.size());
  keyframes_.emplace_back();
  keyframes_.back().id = id;
  keyframes_.back().frame = frame;
  for (const int p : frame.point) {
    if (p >= 0) point(p).keyframes.push_back(id);
  }
  return id;
}

SE3<double> LocalMap::pose(int keyframe) const {
  const Keyframe* k = &this->keyframe(keyframe);
  SE3<double> T;
  while (k->culled()) {
    T = T * k->T_c_parent;
    k = &this->keyframe(k->parent);
  }
  return T * k->frame.T_c_w;
}

int LocalMap::present(int id) const {
  while (id >= 0 && points_[static_cast<std::size_t>(id)].bad)
    id = points_[static_cast<std::size_t>(id)].merged_into;
  return id;
}

void LocalMap::covisible(int keyframe, int min_shared, std::vector<std::pair<int, int>>& out) {
  out.clear();
  votes_.assign(keyframes_.size(), 0);
  for (const int p : this->keyframe(keyframe).frame.point) {
    if (p < 0 || point(p).bad) continue;
    for (const int k : point(p).keyframes) ++votes_[static_cast<std::size_t>(k)];
  }
  votes_[static_cast<std::size_t>(keyframe)] = 0;
  for (int k = 0; k < static_cast<int>(votes_.size()); ++k) {
    if (votes_[static_cast<std::size_t>(k)] >= min_shared)
      out.emplace_back(votes_[static_cast<std::size_t>(k)], k);
  }
  std::sort(out.begin(), out.end(), std::greater<>());
}

void LocalMap::observe(int keyframe, int feature, int id) {
  this->keyframe(keyframe).frame.point[static_cast<std::size_t>(feature)] = id;
  point(id).keyframes.push_back(keyframe);
}

void LocalMap::merge(int gone, int kept) {
  if (gone == kept) return;
  MapPoint &from = point(gone), &to = point(kept);
  for (const int k : from.keyframes) {
    auto& ids = keyframe(k).frame.point;
    const auto at = std::find(ids.begin(), ids.end(), gone);
    if (at == ids.end()) continue;
    const bool seen = std::find(to.keyframes.begin(), to.keyframes.end(), k) != to.keyframes.end();
    *at = seen ? -1 : kept;  // a keyframe shows a point once
    if (!seen) to.keyframes.push_back(k);
  }
  std::sort(to.keyframes.begin(), to.keyframes.end());
  to.visible += from.visible;
  to.found += from.found;
  from.keyframes.clear();
  from.bad = true;
  from.merged_into = kept;
}

std::vector<int> LocalMap::cull_keyframes(int newest, double share, int spare) {
  constexpr std::size_t kWitnesses = 3;
  std::vector<int> culled;
  covisible(newest, 1, neighbours_);
  const auto tried = neighbours_;
  for (const auto& [shared, id] : tried) {
    if (id == 0 || id + spare > newest) continue;
    Keyframe& k = keyframe(id);
    int seen = 0, redundant = 0;
    for (const int p : k.frame.point) {
      if (p < 0 || point(p).bad) continue;
      ++seen;
      redundant += point(p).keyframes.size() > kWitnesses ? 1 : 0;
    }
    if (seen == 0 || redundant < share * seen) continue;
    covisible(id, 1, neighbours_);
    if (neighbours_.empty()) continue;
    const int parent = neighbours_.front().second;
    k.T_c_parent = k.frame.T_c_w * keyframe(parent).frame.T_c_w.inverse();
    k.parent = parent;
    for (const int p : k.frame.point) {
      if (p < 0) continue;
      std::erase(point(p).keyframes, id);
      if (point(p).keyframes.empty()) point(p).bad = true;
    }
    Frame bare;  // only its pose and its place in time are needed any more
    bare.index = k.frame.index;
    bare.t = k.frame.t;
    bare.T_c_w = k.frame.T_c_w;
    k.frame = std::move(bare);
    culled.push_back(id);
  }
  return culled;
}

void LocalMap::local_points(const Frame& frame, int count, std::vector<int>& ids) {
  ids.clear();
  if (keyframes_.empty()) return;
  votes_.assign(keyframes_.size(), 0);
  for (const int p : frame.point) {
    if (p < 0) continue;
    for (const int k : point(p).keyframes) ++votes_[static_cast<std::size_t>(k)];
  }
  order_.clear();
  for (int k = 0; k < static_cast<int>(keyframes_.size()); ++k) {
    if (votes_[static_cast<std::size_t>(k)] > 0) order_.push_back(k);
  }
  std::sort(order_.begin(), order_.end(), [&](int a, int b) {
    return std::pair(votes_[static_cast<std::size_t>(a)], a) >
           std::pair(votes_[static_cast<std::size_t>(b)], b);
  });
  if (static_cast<int>(order_.size()) > count) order_.resize(static_cast<std::size_t>(count));
  order_.push_back(static_cast<int>(keyframes_.size()) - 1);

  stamp_.resize(points_.size(), 0);
  ++present_;
  for (const int k : order_) {
    for (const int p : keyframes_[static_cast<std::size_t>(k)].frame.point) {
      if (p < 0 || stamp_[static_cast<std::size_t>(p)] == present_ || point(p).bad) continue;
      stamp_[static_cast<std::size_t>(p)] = present_;
      ids.push_back(p);
    }
  }
}

void LocalMap::forget(int keyframe, int feature) {
  int& id = keyframes_[static_cast<std::size_t>(keyframe)].frame.point[static_cast<std::size_t>(feature)];
  if (id < 0) return;
  MapPoint& p = point(id);
  std::erase(p.keyframes, keyframe);
  if (p.keyframes.empty()) p.bad = true;
  id = -1;
}

void LocalMap::cull() {
  constexpr int kTrial = 12;
  for (MapPoint& p : points_) {
    if (p.bad) continue;
    if (p.visible >= kTrial && 4 * p.found < p.visible) p.bad = true;
    if (p.on_mover >= 3 && 2 * p.on_mover > p.found) p.bad = true;
  }
}

}  // namespace dynslam::runtime
