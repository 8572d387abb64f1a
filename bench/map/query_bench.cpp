// SPDX-License-Identifier: BSD-3-Clause
// What a planner pays for an answer, from a map of a room and some clusters up to hundreds of metres away:
// coarse cells, rays, the nearest obstacle; beside a look at every voxel (cell) or at every occupied one
// (nearest). Arguments: level, or distance to what there is [voxels].
#include <benchmark/benchmark.h>

#include <cmath>
#include <limits>
#include <vector>

#include "dynslam/semantic/map_query.hpp"
#include "dynslam/semantic/scan_voxels.hpp"
#include "dynslam/semantic/voxel_block_map.hpp"
#include "support/rng.hpp"

namespace {

using dynslam::VoxelKey;

constexpr double kEdge = 0.05;

const dynslam::VoxelBlockMap<float>& map() {
  static const auto built = [] {
    const dynslam::VoxelGrid grid(kEdge);
    dynslam::VoxelBlockMap<float> out(grid);
    dynslam::ScanVoxels scan(grid);
    dynslam::bench::Random rng(7);
    const Eigen::Vector3f eye(0.012F, 0.013F, 0.011F);
    for (int i = 0; i < 20000; ++i) {  // a room of 5 x 5 x 5 m
      const Eigen::Vector3d d(rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1));
      const Eigen::Vector3f p = (d * (2.5 / d.cwiseAbs().maxCoeff())).cast<float>();
      scan.add_end(p, 2, {});
      scan.carve(eye, p);
    }
    for (int c = 0; c < 500; ++c) {  // and things all over a large place
      const Eigen::Vector3d centre(rng.uniform(-300, 300), rng.uniform(-300, 300), rng.uniform(-300, 300));
      for (int i = 0; i < 40; ++i)
        scan.add_end(Eigen::Vector3d(centre + 0.3 * Eigen::Vector3d(rng.uniform(-1, 1), rng.uniform(-1, 1),
                                                                    rng.uniform(-1, 1))),
                     3, {});
    }
    scan.finish();
    out.integrate(scan);
    return out;
  }();
  return built;
}

void cell(benchmark::State& state) {
  const int level = static_cast<int>(state.range(0));
  const VoxelKey key = *map().grid().key(Eigen::Vector3d(1, 1, 1));
  if (map().at(key, 15).state != dynslam::Occupancy::occupied) {
    state.SkipWithError("the room is not in the map");
    return;
  }
  for (auto _ : state) benchmark::DoNotOptimize(map().at(key, level));
}
BENCHMARK(cell)->DenseRange(0, 8, 2)->Arg(15)->ArgName("level");

/// The same from all of its voxels, as an oracle does it.
void cell_by_voxels(benchmark::State& state) {
  const int level = static_cast<int>(state.range(0)), n = 1 << level;
  const VoxelKey low = dynslam::key_at_level(*map().grid().key(Eigen::Vector3d(1, 1, 1)), level);
  for (auto _ : state) {
    float largest = -1e9F;
    for (int z = 0; z < n; ++z) {
      for (int y = 0; y < n; ++y) {
        for (int x = 0; x < n; ++x) {
          const auto voxel =
              map().at({{static_cast<std::uint16_t>(low[0] + x), static_cast<std::uint16_t>(low[1] + y),
                         static_cast<std::uint16_t>(low[2] + z)}});
          if (voxel.state != dynslam::Occupancy::unknown) largest = std::max(largest, voxel.log_odds);
        }
      }
    }
    benchmark::DoNotOptimize(largest);
  }
}
BENCHMARK(cell_by_voxels)->DenseRange(2, 8, 2)->ArgName("level");

void ray(benchmark::State& state) {
  const dynslam::RayOptions options{.max_range = 10, .level = static_cast<int>(state.range(0))};
  double angle = 0;
  for (auto _ : state) {
    angle += 0.1;
    benchmark::DoNotOptimize(
        dynslam::cast_ray(map(), {0, 0, 0}, {std::cos(angle), std::sin(angle), 0.1}, options));
  }
}
BENCHMARK(ray)->Arg(0)->Arg(2)->ArgName("level");

/// Points at a distance from the room's wall, outward: 0.2 m to 20 m, and without any limit of the radius.
void nearest(benchmark::State& state) {
  const Eigen::Vector3d p(2.5 + kEdge * static_cast<double>(state.range(0)), 0.3, 0.2);
  const double radius = std::numeric_limits<double>::infinity();
  double best = radius;
  dynslam::query_box(map(), {-radius, -radius, -radius}, {radius, radius, radius}, 0, [&](const auto& c) {
    best = std::min(best, dynslam::distance_to_cell(p, c.centre, c.edge));
  });
  if (dynslam::nearest_obstacle(map(), p, radius).cell.distance != best) {
    state.SkipWithError("not the nearest");
    return;
  }
  for (auto _ : state) benchmark::DoNotOptimize(dynslam::nearest_obstacle(map(), p, radius));
}
BENCHMARK(nearest)->Arg(4)->Arg(40)->Arg(400)->Arg(4000)->ArgName("voxels");

void nearest_by_all(benchmark::State& state) {
  const Eigen::Vector3d p(2.5 + kEdge * static_cast<double>(state.range(0)), 0.3, 0.2);
  const double far = std::numeric_limits<double>::infinity();
  for (auto _ : state) {
    double best = far;
    dynslam::query_box(map(), {-far, -far, -far}, {far, far, far}, 0, [&](const auto& c) {
      best = std::min(best, dynslam::distance_to_cell(p, c.centre, c.edge));
    });
    benchmark::DoNotOptimize(best);
  }
}
BENCHMARK(nearest_by_all)->Arg(40)->ArgName("voxels");

}  // namespace

BENCHMARK_MAIN();
