// SPDX-License-Identifier: BSD-3-Clause
#include "slam/tidy_map.hpp"

#include <cstddef>

namespace dynslam::runtime {

std::vector<int> tidy_map(LocalMap& map, const std::vector<int>& scanned) {
  (void)map.drop_bad_points();
  std::vector<bool> needed(map.keyframes().size(), false);
  const auto need = [&](int keyframe) { needed[static_cast<std::size_t>(keyframe)] = true; };
  for (const int id : scanned) need(id);
  for (const MapPoint& p : map.points()) {
    if (p.patch.level >= 0) need(p.patch.keyframe);
  }
  std::vector<int> ids = map.drop_culled(needed);
  for (MapPoint& p : map.points()) {
    if (p.patch.level >= 0) p.patch.keyframe = ids[static_cast<std::size_t>(p.patch.keyframe)];
  }
  return ids;
}

}  // namespace dynslam::runtime
