// SPDX-License-Identifier: BSD-3-Clause
// What a planner pays for an answer, from a map of a room and some clusters up to hundreds of metres away:
// coarse cells, rays, the nearest obstacle; the voxel block map and the semantic octree, beside OctoMap, and
// a look at every voxel (scalar). Every answer is compared with the rival's.
#include <benchmark/benchmark.h>

#include <cmath>
#include <limits>
#include <string>

#ifdef DYNSLAM_BENCH_OCTOMAP
#include "baselines/octomap_queries.hpp"
#include "dynslam/interop/octomap_semantic_tree.hpp"
#endif
#include "dynslam/semantic/map_query.hpp"
#include "dynslam/semantic/scan_voxels.hpp"
#include "dynslam/semantic/voxel_block_map.hpp"
#include "support/named.hpp"
#include "support/rng.hpp"

namespace {

using namespace dynslam;

constexpr double kEdge = 0.05;

const ScanVoxels& scan() {
  static const ScanVoxels built = [] {
    ScanVoxels out{VoxelGrid(kEdge)};
    bench::Random rng(7);
    const Eigen::Vector3f eye(0.012F, 0.013F, 0.011F);
    for (int i = 0; i < 20000; ++i) {  // a room of 5 x 5 x 5 m
      const Eigen::Vector3d d(rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1));
      const Eigen::Vector3f p = (d * (2.5 / d.cwiseAbs().maxCoeff())).cast<float>();
      out.add_end(p, 2, {});
      out.carve(eye, p);
    }
    for (int c = 0; c < 500; ++c) {  // and things all over a large place
      const Eigen::Vector3d centre(rng.uniform(-300, 300), rng.uniform(-300, 300), rng.uniform(-300, 300));
      for (int i = 0; i < 40; ++i)
        out.add_end(Eigen::Vector3d(centre + 0.3 * Eigen::Vector3d(rng.uniform(-1, 1), rng.uniform(-1, 1),
                                                                   rng.uniform(-1, 1))),
                    3, {});
    }
    out.finish();
    return out;
  }();
  return built;
}

struct BlockMap {
  static const VoxelBlockMap<float>& map() {
    static const auto built = [] {
      VoxelBlockMap<float> out(scan().grid());
      out.integrate(scan());
      return out;
    }();
    return built;
  }
};

/// Rays all around, on and on.
template <class Cast>
void cast_rays(benchmark::State& state, const Cast& cast) {
  double angle = 0;
  for (auto _ : state) {
    angle += 0.1;
    benchmark::DoNotOptimize(cast(Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.1)));
  }
}

template <class Map>
void ray(benchmark::State& state, int level) {
  const RayOptions options{.max_range = 10, .level = level};
  cast_rays(state, [&](const Eigen::Vector3d& d) { return cast_ray(Map::map(), {0, 0, 0}, d, options); });
}

template <class Map>
void cell(benchmark::State& state, int level) {
  const VoxelKey key = *scan().grid().key(Eigen::Vector3d(1, 1, 1));
  if (Map::map().at(key, 15).state != Occupancy::occupied) {
    state.SkipWithError("the room is not in the map");
    return;
  }
  for (auto _ : state) benchmark::DoNotOptimize(Map::map().at(key, level));
}

/// The same from all of its voxels, as an oracle does it.
void cell_by_voxels(benchmark::State& state, int level) {
  const int n = 1 << level;
  const VoxelKey low = key_at_level(*scan().grid().key(Eigen::Vector3d(1, 1, 1)), level);
  for (auto _ : state) {
    float largest = -1e9F;
    for (int z = 0; z < n; ++z) {
      for (int y = 0; y < n; ++y) {
        for (int x = 0; x < n; ++x) {
          const auto voxel = BlockMap::map().at(
              {{static_cast<std::uint16_t>(low[0] + x), static_cast<std::uint16_t>(low[1] + y),
                static_cast<std::uint16_t>(low[2] + z)}});
          if (voxel.state != Occupancy::unknown) largest = std::max(largest, voxel.log_odds);
        }
      }
    }
    benchmark::DoNotOptimize(largest);
  }
}

/// At a distance from the room's wall, outward.
Eigen::Vector3d outside(double metres) {
  return {2.5 + metres, 0.3, 0.2};
}
double nearest_of_all(const Eigen::Vector3d& p) {
  const double far = std::numeric_limits<double>::infinity();
  double best = far;
  query_box(BlockMap::map(), {-far, -far, -far}, {far, far, far}, 0,
            [&](const auto& c) { best = std::min(best, distance_to_cell(p, c.centre, c.edge)); });
  return best;
}

/// Without any limit of the radius.
template <class Map>
void nearest(benchmark::State& state, double metres) {
  const Eigen::Vector3d p = outside(metres);
  const double radius = std::numeric_limits<double>::infinity();
  if (std::abs(nearest_obstacle(Map::map(), p, radius).cell.distance - nearest_of_all(p)) > 1e-9) {
    state.SkipWithError("not the nearest");
    return;
  }
  for (auto _ : state) benchmark::DoNotOptimize(nearest_obstacle(Map::map(), p, radius));
}

#ifdef DYNSLAM_BENCH_OCTOMAP
struct SemanticTree {
  static const interop::SemanticOcTree& map() {
    static const interop::SemanticOcTree* const built = [] {
      auto* out = new interop::SemanticOcTree(kEdge);
      out->integrate(scan());
      return out;
    }();
    return *built;
  }
};
const octomap::OcTree& octree() {
  static const octomap::OcTree* const built = [] {
    auto* out = new octomap::OcTree(kEdge);
    baselines::insert_voxels(*out, scan());
    return out;
  }();
  return *built;
}

void octomap_cell(benchmark::State& state, int level) {
  const VoxelKey key = *scan().grid().key(Eigen::Vector3d(1, 1, 1));
  const octomap::OcTreeKey own(key[0], key[1], key[2]);
  if (octree().search(own, 1) == nullptr) {
    state.SkipWithError("the room is not in the map");
    return;
  }
  for (auto _ : state) benchmark::DoNotOptimize(octree().search(own, static_cast<unsigned>(16 - level)));
}
void octomap_ray(benchmark::State& state) {
  const octomap::point3d origin(0, 0, 0);
  const auto cast = [&](const Eigen::Vector3d& d) {
    octomap::point3d end;
    const octomap::point3d direction(static_cast<float>(d.x()), static_cast<float>(d.y()),
                                     static_cast<float>(d.z()));
    return octree().castRay(origin, direction, end, true, 10) ? end : octomap::point3d();
  };
  int differ = 0;
  for (int k = 0; k < 1000; ++k) {
    const Eigen::Vector3d d(std::cos(0.1 * k), std::sin(0.1 * k), 0.1);
    const auto end = cast(d);
    const auto ours = cast_ray(BlockMap::map(), {0, 0, 0}, d, {.max_range = 10});
    differ +=
        (ours.cell.centre - Eigen::Vector3f(end.x(), end.y(), end.z()).cast<double>()).norm() > 1e-3 ? 1 : 0;
  }
  if (differ > 5) {  // OctoMap's direction is float: a ray along an edge may go another way
    state.SkipWithError("the rays meet other cells");
    return;
  }
  cast_rays(state, cast);
}
void octomap_nearest(benchmark::State& state, double metres) {
  const Eigen::Vector3d p = outside(metres);
  if (std::abs(baselines::nearest_in_boxes(octree(), p, 1000) - nearest_of_all(p)) > 1e-9) {
    state.SkipWithError("not the nearest");
    return;
  }
  for (auto _ : state) benchmark::DoNotOptimize(baselines::nearest_in_boxes(octree(), p, 1000));
}
#endif

template <class Map>
void register_map(const char* who) {
  for (const int level : {0, 4, 8})
    bench::add(
        "map_cell/level_" + std::to_string(level), "float", who,
        [=](benchmark::State& s) { cell<Map>(s, level); }, benchmark::kNanosecond);
  for (const int level : {0, 2})
    bench::add("map_ray/level_" + std::to_string(level), "float", who,
               [=](benchmark::State& s) { ray<Map>(s, level); });
  for (const double metres : {0.2, 2.0, 20.0})
    bench::add("map_nearest/" + std::to_string(int(100 * metres)) + "cm", "float", who,
               [=](benchmark::State& s) { nearest<Map>(s, metres); });
}

const bool registered = [] {
  register_map<BlockMap>("dynslam");
#ifdef DYNSLAM_BENCH_OCTOMAP
  register_map<SemanticTree>("dynslam_octree");
  for (const int level : {0, 4, 8})
    bench::add(
        "map_cell/level_" + std::to_string(level), "float", "octomap",
        [=](benchmark::State& s) { octomap_cell(s, level); }, benchmark::kNanosecond);
  bench::add("map_ray/level_0", "float", "octomap", octomap_ray);
  for (const double metres : {0.2, 2.0, 20.0})
    bench::add("map_nearest/" + std::to_string(int(100 * metres)) + "cm", "float", "octomap",
               [=](benchmark::State& s) { octomap_nearest(s, metres); });
#endif
  bench::add("map_cell/level_4", "float", "scalar", [](benchmark::State& s) { cell_by_voxels(s, 4); });
  bench::add("map_nearest/200cm", "float", "scalar", [](benchmark::State& s) {
    for (auto _ : s) benchmark::DoNotOptimize(nearest_of_all(outside(2)));
  });
  return true;
}();

}  // namespace

BENCHMARK_MAIN();
