// SPDX-License-Identifier: BSD-3-Clause
// Maps whose every voxel is what a function says, seen once.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "dynslam/semantic/log_odds.hpp"
#include "dynslam/semantic/scan_voxels.hpp"

namespace dynslam::test {

/// What a voxel is to be.
struct Paint {
  Occupancy state = Occupancy::unknown;
  std::uint8_t label = 0;
};

/// Fuses into a map what `paint(centre)` says of each voxel whose centre lies in the box [low, high].
template <class Map, class F>
void paint_map(Map& map, const Eigen::Vector3d& low, const Eigen::Vector3d& high, F&& paint) {
  const VoxelGrid grid = map.grid();
  typename Map::Scan scan(grid);
  const auto first = grid.key(low), last = grid.key(high);
  REQUIRE(first.has_value());
  REQUIRE(last.has_value());
  VoxelKey key;
  for (key[2] = (*first)[2]; key[2] <= (*last)[2]; ++key[2])
    for (key[1] = (*first)[1]; key[1] <= (*last)[1]; ++key[1])
      for (key[0] = (*first)[0]; key[0] <= (*last)[0]; ++key[0]) {
        const Eigen::Vector3d centre = grid.centre(key);
        const Paint voxel = paint(centre);
        if (voxel.state == Occupancy::occupied)
          scan.add_end(centre, voxel.label, {200, 100, 50});
        else if (voxel.state == Occupancy::free)  // a ray leaves out the voxel in which it ends
          scan.carve(centre, Eigen::Vector3d(centre + Eigen::Vector3d(grid.resolution(), 0, 0)));
      }
  scan.finish();
  map.integrate(scan);
}

}  // namespace dynslam::test
