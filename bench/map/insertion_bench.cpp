// SPDX-License-Identifier: BSD-3-Clause
// Insertion of 20 keyframes into a semantic octree, beside OctoMap's ColorOcTree with the same points, range
// and resolution, on one thread. The keyframes are recorded ones (fr1_xyz) where DYNSLAM_DATA names the data,
// a made-up room otherwise. Arguments: edge of a voxel [mm], discretize.
#include <benchmark/benchmark.h>

#ifdef DYNSLAM_BENCH_OCTOMAP
#include <malloc.h>
#include <octomap/ColorOcTree.h>

#include <vector>

#include "dynslam/interop/octomap_semantic_tree.hpp"
#include "dynslam/semantic/voxel_block_map.hpp"
#include "recorded_scans.hpp"

namespace {

using dynslam::test::WorldScan;

constexpr double kMaxRange = 4.0;

const std::vector<WorldScan>& scans() {
  static const std::vector<WorldScan> all = [] {
    auto recorded = dynslam::test::recorded_scans(20, 1);
    return recorded.empty() ? dynslam::test::room_scans(3, 64, 48) : recorded;
  }();
  return all;
}

const std::vector<octomap::Pointcloud>& clouds() {
  static const std::vector<octomap::Pointcloud> all = [] {
    std::vector<octomap::Pointcloud> out;
    for (const WorldScan& scan : scans()) {
      out.emplace_back();
      for (const auto& point : scan.points) out.back().push_back(point.p.x(), point.p.y(), point.p.z());
    }
    return out;
  }();
  return all;
}

void insert_semantic(dynslam::interop::SemanticOcTree& tree, dynslam::ScanVoxels& voxels, bool discretize) {
  for (const WorldScan& scan : scans()) {
    dynslam::gather_point_cloud(voxels, scan.points, scan.origin, kMaxRange, discretize);
    tree.integrate(voxels);
  }
}

/// What a user of ColorOcTree does: insertPointCloud, then the colour of every point.
void insert_octomap(octomap::ColorOcTree& tree, bool lazy, bool discretize) {
  for (std::size_t k = 0; k < scans().size(); ++k) {
    const Eigen::Vector3f& o = scans()[k].origin;
    const octomap::point3d origin(o.x(), o.y(), o.z());
    tree.insertPointCloud(clouds()[k], origin, kMaxRange, lazy, discretize);
    for (const auto& point : scans()[k].points) {
      if ((point.p - o).norm() > static_cast<float>(kMaxRange)) continue;
      tree.integrateNodeColor(point.p.x(), point.p.y(), point.p.z(), point.rgb[0], point.rgb[1],
                              point.rgb[2]);
    }
    if (lazy) tree.updateInnerOccupancy();
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
  state.counters["nodes"] = static_cast<double>(tree.size());
  state.counters["voxels"] = voxels;
  state.counters["heap_bytes_per_voxel"] = bytes / voxels;
  state.counters["heap_bytes_per_node"] = bytes / static_cast<double>(tree.size());
}

void semantic(benchmark::State& state) {
  const double edge = 1e-3 * static_cast<double>(state.range(0));
  const bool discretize = state.range(1) != 0;
  dynslam::ScanVoxels voxels{dynslam::VoxelGrid(edge)};
  {  // the answer first
    dynslam::interop::SemanticOcTree tree(edge);
    insert_semantic(tree, voxels, discretize);
    {
      dynslam::interop::SemanticOcTree again(edge);  // the scan's memory exists now
      const double start = heap_bytes();
      insert_semantic(again, voxels, discretize);
      memory_counters(state, again, heap_bytes() - start);
    }
    octomap::ColorOcTree rival(edge);
    insert_octomap(rival, false, discretize);
    if (largest_difference(tree, rival) > 1e-5 || largest_difference(rival, tree) > 1e-5) {
      state.SkipWithError("the occupancy differs from OctoMap's");
      return;
    }
  }
  for (auto _ : state) {
    dynslam::interop::SemanticOcTree tree(edge);
    insert_semantic(tree, voxels, discretize);
    benchmark::DoNotOptimize(tree.size());
  }
  state.counters["time_per_keyframe"] =
      benchmark::Counter(static_cast<double>(scans().size()),
                         benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

void color_octree(benchmark::State& state, bool lazy) {
  const double edge = 1e-3 * static_cast<double>(state.range(0));
  const bool discretize = state.range(1) != 0;
  {
    octomap::ColorOcTree tree(edge);
    const double start = heap_bytes();
    insert_octomap(tree, lazy, discretize);
    memory_counters(state, tree, heap_bytes() - start);
  }
  for (auto _ : state) {
    octomap::ColorOcTree tree(edge);
    insert_octomap(tree, lazy, discretize);
    benchmark::DoNotOptimize(tree.size());
  }
  state.counters["time_per_keyframe"] =
      benchmark::Counter(static_cast<double>(scans().size()),
                         benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

void octomap_color(benchmark::State& state) {
  color_octree(state, false);
}
void octomap_color_lazy(benchmark::State& state) {
  color_octree(state, true);
}

void block_map(benchmark::State& state) {
  const double edge = 1e-3 * static_cast<double>(state.range(0));
  dynslam::ScanVoxels voxels{dynslam::VoxelGrid(edge)};
  for (auto _ : state) {
    dynslam::VoxelBlockMap<float> map{voxels.grid()};
    for (const WorldScan& scan : scans()) {
      dynslam::gather_point_cloud(voxels, scan.points, scan.origin, kMaxRange, state.range(1) != 0);
      map.integrate(voxels);
    }
    benchmark::DoNotOptimize(map.blocks());
  }
  state.counters["time_per_keyframe"] =
      benchmark::Counter(static_cast<double>(scans().size()),
                         benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

void edges(benchmark::internal::Benchmark* b) {
  for (const int edge : {50, 20}) {
    for (const int discretize : {0, 1}) b->Args({edge, discretize});
  }
  b->ArgNames({"mm", "discretize"})->Unit(benchmark::kMillisecond);
}
BENCHMARK(semantic)->Apply(edges);
BENCHMARK(octomap_color)->Apply(edges);
BENCHMARK(octomap_color_lazy)->Apply(edges);
BENCHMARK(block_map)->Apply(edges);

}  // namespace
#endif

BENCHMARK_MAIN();
