// SPDX-License-Identifier: BSD-3-Clause
//
// Example 3: a semantic map that a planner asks, without OctoMap.
//
// A depth camera looks into a corridor with a chair in it. Each scan is gathered into voxels and fused; then
// come the questions of a robot 0.3 m in radius: what is ahead, is the way free, what is the nearest
// obstacle, and the same in coarse cells, which a planner searches first. A person who stood there for two
// scans is gone at the end.
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <optional>

#include <dynslam/semantic/map_query.hpp>
#include <dynslam/semantic/scan_voxels.hpp>
#include <dynslam/semantic/voxel_block_map.hpp>

namespace {

constexpr std::uint8_t kBackground = 0, kPerson = 1, kChair = 2;

struct Seen {
  double distance;
  std::uint8_t label;
};

/// What a ray from the origin meets: walls at x = +-1 and z = 4, floor at y = 1, a chair, perhaps a person.
Seen look(const Eigen::Vector3d& ray, bool person) {
  Seen seen{4.0 / ray.z(), kBackground};
  const auto nearer = [&](double t, std::uint8_t label) {
    if (t > 0 && t < seen.distance) seen = {t, label};
  };
  if (ray.x() != 0) nearer(std::copysign(1.0, ray.x()) / ray.x(), kBackground);
  if (ray.y() > 0) nearer(1.0 / ray.y(), kBackground);
  const auto panel = [&](double z, double x0, double x1, double y0, std::uint8_t label) {
    const Eigen::Vector3d p = ray * (z / ray.z());
    if (p.x() > x0 && p.x() < x1 && p.y() > y0 && p.y() < 1.0) nearer(z / ray.z(), label);
  };
  panel(2.5, 0.2, 0.7, 0.1, kChair);
  if (person) panel(1.5, -0.5, 0.1, -0.7, kPerson);
  return seen;
}

}  // namespace

int main() {
  const dynslam::VoxelGrid grid(0.05);
  dynslam::VoxelBlockMap<float> map(grid);
  dynslam::ScanVoxels scan(grid);  // keeps its memory from scan to scan

  const Eigen::Vector3f eye(0.01F, 0.01F, 0.01F);
  for (int k = 0; k < 8; ++k) {
    scan.clear();
    for (int v = -60; v <= 60; ++v) {
      for (int u = -80; u <= 80; ++u) {
        const Eigen::Vector3d ray(u / 100.0, v / 100.0, 1.0);
        const Seen seen = look(ray, k < 2);
        const Eigen::Vector3f p = eye + (ray * seen.distance).cast<float>();
        // In the first scan the network misses the person; in the second it is masked: no end, but a free way
        // to it.
        const bool mapped = seen.label != kPerson || k == 0;
        if (mapped) scan.add_end(p, seen.label == kPerson ? kBackground : seen.label, {200, 180, 160});
        scan.carve(eye, p);
      }
    }
    scan.finish();
    map.integrate(scan);
  }

  const auto ahead = dynslam::cast_ray(map, {0.4, 0.5, 0.2}, {0, 0, 1}, {.max_range = 5.0});
  if (ahead.status != dynslam::RayStatus::hit) return 1;
  std::printf("ahead of the robot: label %d at %.2f m, confidence %.2f\n", ahead.cell.voxel.label,
              ahead.distance, static_cast<double>(ahead.cell.voxel.confidence));

  // Unknown space counts as an obstacle here: a careful planner drives where it has seen.
  const auto left =
      dynslam::cast_ray(map, {-0.4, 0.5, 1.0}, {0, 0, 1}, {.max_range = 2.5, .stop_at_unknown = true});
  if (left.blocked()) {
    std::printf("the way on the left ends after %.2f m: %s\n", left.distance,
                left.status == dynslam::RayStatus::unknown ? "unknown" : "occupied");
  } else {
    std::printf("the way on the left is free\n");
  }

  const auto nearest = dynslam::nearest_obstacle(map, {0.3, 0.4, 2.0}, 1.0);
  if (!nearest.found()) return 1;
  std::printf("nearest obstacle: label %d, %.2f m\n", nearest.cell.voxel.label, nearest.cell.distance);

  for (const int level : {0, 2, 3}) {
    int cells = 0, chairs = 0;
    dynslam::query_box(map, {-1.2, -1, 0}, {1.2, 1.2, 4.2}, level, [&](const auto& cell) {
      ++cells;
      chairs += cell.voxel.label == kChair ? 1 : 0;
    });
    std::printf("cells of %.2f m: %5d occupied, %4d of them chair\n", grid.edge(level), cells, chairs);
    if (chairs == 0) return 1;
  }

  const auto person = dynslam::query_point(map, {-0.2, 0.2, 1.51});
  std::printf("where the person stood: %s\n", person.state == dynslam::Occupancy::free ? "free" : "not free");

  const bool right = ahead.cell.voxel.label == kChair && std::abs(ahead.distance - 2.3) < 0.06 &&
                     !left.blocked() && nearest.cell.voxel.label == kChair &&
                     std::abs(nearest.cell.distance - 0.5) < 0.06 && person.state == dynslam::Occupancy::free;
  return right ? 0 : 1;
}
