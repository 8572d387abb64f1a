// SPDX-License-Identifier: BSD-3-Clause
//
// Example 7: a voxel map with 20 labels, filled from a depth and a label image, and asked by a planner.
#include <cmath>
#include <cstdio>
#include <dynslam/geometry/pinhole.hpp>
#include <dynslam/semantic/map_query.hpp>
#include <dynslam/semantic/scan_voxels.hpp>
#include <dynslam/semantic/voxel_block_map.hpp>

int main() {
  constexpr std::uint8_t kSofa = 17, kWall = 0, kLabels = 20;  // of Pascal VOC, say
  const dynslam::Pinhole<float> camera(100.0F, 100.0F, 80.0F, 60.0F);
  dynslam::VoxelBlockMap<float, kLabels> map(dynslam::VoxelGrid(0.05));
  dynslam::BasicScanVoxels<kLabels> scan(map.grid());  // keeps its memory from scan to scan

  const Eigen::Vector3f eye(0.01F, 0.01F, 0.01F);  // the camera in the map; it looks along z
  for (int k = 0; k < 3; ++k) {
    scan.clear();
    for (int v = 0; v < 120; ++v) {
      for (int u = 0; u < 160; ++u) {  // a sofa 2 m ahead on the right, a wall at 4 m
        const bool sofa = u > 90 && v > 50;
        const Eigen::Vector3f p = eye + *camera.unproject({float(u), float(v)}, sofa ? 2.0F : 4.0F);
        scan.add_end(p, sofa ? kSofa : kWall, {128, 128, 128});
        scan.carve(eye, p);
      }
    }
    scan.finish();
    map.integrate(scan);
  }

  const auto ahead = dynslam::cast_ray(map, {0.4, 0.3, 0.2}, {0, 0, 1}, {.max_range = 5.0});
  const auto left = dynslam::cast_ray(map, {-0.2, 0.0, 0.6}, {0, 0, 1}, {.max_range = 3.0});
  const auto nearest = dynslam::nearest_obstacle(map, {0.3, 0.2, 1.0}, 2.0);
  std::printf("ahead: label %d at %.2f m; nearest obstacle: %.2f m; the way on the left is %s\n",
              ahead.cell.voxel.label, ahead.distance, nearest.cell.distance,
              left.blocked() ? "shut" : "free");
  const bool right = ahead.cell.voxel.label == kSofa && std::abs(nearest.cell.distance - 1.0) < 0.1;
  return right && !left.blocked() ? 0 : 1;
}
