// SPDX-License-Identifier: BSD-3-Clause
// Insertion of keyframes into a semantic octree, beside OctoMap's ColorOcTree with the same points, range and
// resolution, and the voxel block map. The keyframes are recorded ones (fr1_xyz, all pixels) where
// DYNSLAM_DATA names the data, a made-up room otherwise. A ray goes to each point, or to each voxel that
// holds points (OctoMap's `discretize`).
#include <benchmark/benchmark.h>

#ifdef DYNSLAM_BENCH_OCTOMAP
#include <malloc.h>

#include <string>
#include <vector>

#include "baselines/color_octree.hpp"
#include "dynslam/interop/octomap_semantic_tree.hpp"
#include "dynslam/semantic/voxel_block_map.hpp"
#include "recorded_scans.hpp"
#include "support/named.hpp"

namespace {

using namespace dynslam;
using test::WorldScan;

constexpr double kMaxRange = 4.0;

struct Case {
  std::string name;
  double edge;  // of a voxel [m]
  bool discretize;
};

/// Twenty where a ray goes to each voxel; where one goes to each point five take the rival long enough.
const std::vector<WorldScan>& scans(const Case& c) {
  static const auto make = [](std::size_t count) {
    auto recorded = test::recorded_scans(count, 1);
    return recorded.empty() ? test::room_scans(3, 64, 48) : recorded;
  };
  if (!c.discretize) {
    static const std::vector<WorldScan> few = make(5);
    return few;
  }
  static const std::vector<WorldScan> many = make(20);
  return many;
}

template <class Map>
void insert(Map& map, ScanVoxels& voxels, const Case& c) {
  for (const WorldScan& scan : scans(c)) {
    gather_point_cloud(voxels, scan.points, scan.origin, kMaxRange, c.discretize);
    map.integrate(voxels);
  }
}

double heap_bytes() {
  return static_cast<double>(mallinfo2().uordblks);
}

/// Largest difference in log-odds over the leaves of a tree, looked up in another one.
template <class A, class B>
double largest_difference(const A& a, const B& b) {
  double largest = 0;
  for (auto it = a.begin_leafs(), end = a.end_leafs(); it != end; ++it) {
    const auto* other = b.search(it.getKey());
    if (other == nullptr) return 1e9;
    largest = std::max(largest, std::abs(static_cast<double>(it->getLogOdds() - other->getLogOdds())));
  }
  return largest;
}

template <class Tree>
void memory_counters(benchmark::State& state, const Tree& tree, double bytes) {
  // Voxels as if nothing were pruned; nodes as they are.
  double voxels = 0;
  for (auto it = tree.begin_leafs(), end = tree.end_leafs(); it != end; ++it)
    voxels += std::pow(8.0, int(tree.getTreeDepth() - it.getDepth()));
  state.counters["voxels"] = voxels;
  state.counters["heap_bytes_per_voxel"] = bytes / voxels;
  state.counters["heap_MB"] = 1e-6 * bytes;
}

/// Whether the occupancy is OctoMap's; looked at once for each case.
bool equals_octomap(const Case& c) {
  static std::vector<std::string> equal;
  if (std::find(equal.begin(), equal.end(), c.name) != equal.end()) return true;
  ScanVoxels voxels{VoxelGrid(c.edge)};
  interop::SemanticOcTree tree(c.edge);
  insert(tree, voxels, c);
  octomap::ColorOcTree rival(c.edge);
  baselines::ColorTreeScans(scans(c), kMaxRange).insert(rival, false, c.discretize);
  if (largest_difference(tree, rival) > 1e-5 || largest_difference(rival, tree) > 1e-5) return false;
  equal.push_back(c.name);
  return true;
}

void per_keyframe(benchmark::State& state, const Case& c) {
  state.counters["time_per_keyframe"] =
      benchmark::Counter(static_cast<double>(scans(c).size()),
                         benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

void semantic_tree(benchmark::State& state, const Case& c) {
  if (!equals_octomap(c)) {
    state.SkipWithError("the occupancy differs from OctoMap's");
    return;
  }
  ScanVoxels voxels{VoxelGrid(c.edge)};
  for (auto _ : state) {
    interop::SemanticOcTree tree(c.edge);
    insert(tree, voxels, c);
    benchmark::DoNotOptimize(tree.size());
  }
  const double start = heap_bytes();  // the scan's memory exists by now
  interop::SemanticOcTree tree(c.edge);
  insert(tree, voxels, c);
  memory_counters(state, tree, heap_bytes() - start);
  per_keyframe(state, c);
}

void color_octree(benchmark::State& state, const Case& c, bool lazy) {
  const baselines::ColorTreeScans clouds(scans(c), kMaxRange);
  for (auto _ : state) {
    octomap::ColorOcTree tree(c.edge);
    clouds.insert(tree, lazy, c.discretize);
    benchmark::DoNotOptimize(tree.size());
  }
  const double start = heap_bytes();
  octomap::ColorOcTree tree(c.edge);
  clouds.insert(tree, lazy, c.discretize);
  state.counters["heap_MB"] = 1e-6 * (heap_bytes() - start);
  per_keyframe(state, c);
}

template <class S>
void block_map(benchmark::State& state, const Case& c) {
  ScanVoxels voxels{VoxelGrid(c.edge)};
  for (auto _ : state) {
    VoxelBlockMap<S> map{voxels.grid()};
    insert(map, voxels, c);
    benchmark::DoNotOptimize(map.blocks());
  }
  const double start = heap_bytes();
  VoxelBlockMap<S> map{voxels.grid()};
  insert(map, voxels, c);
  state.counters["heap_MB"] = 1e-6 * (heap_bytes() - start);
  per_keyframe(state, c);
}

const bool registered = [] {
  constexpr auto kUnit = benchmark::kMillisecond;
  for (const int mm : {50, 20}) {
    for (const bool discretize : {false, true}) {
      const Case c{
          "insertion/" + std::to_string(mm / 10) + (discretize ? "cm_ray_per_voxel" : "cm_ray_per_point"),
          1e-3 * mm, discretize};
      const auto add = [&](const char* who, auto f) {
        bench::add(
            c.name, "float", who, [=](benchmark::State& s) { f(s, c); }, kUnit);
      };
      add("dynslam", semantic_tree);
      add("octomap", [](auto& s, const Case& of) { color_octree(s, of, false); });
      add("octomap_lazy", [](auto& s, const Case& of) { color_octree(s, of, true); });
      add("dynslam_block_map", block_map<float>);
    }
  }
  return true;
}();

}  // namespace
#endif

BENCHMARK_MAIN();
