// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/local_map.hpp"

#include <algorithm>
#include <utility>

namespace dynslam::runtime {

int LocalMap::add_point(MapPoint point) {
  points_.push_back(std::move(point));
  return static_cast<int>(points_.size()) - 1;
}

int LocalMap::add_keyframe(const Frame& frame) {
  const int id = static_cast<int>(keyframes_.size());
  keyframes_.push_back({id, frame});
  for (const int p : frame.point) {
    if (p >= 0) point(p).keyframes.push_back(id);
  }
  return id;
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
