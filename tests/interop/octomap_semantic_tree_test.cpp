// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/interop/octomap_semantic_tree.hpp"

#include <doctest/doctest.h>
#include <octomap/ColorOcTree.h>
#include <octomap/OcTree.h>

#include <limits>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "dynslam/interop/octomap.hpp"
#include "dynslam/semantic/map_query.hpp"
#include "dynslam/semantic/voxel_block_map.hpp"
#include "random.hpp"
#include "tree_compare.hpp"

using namespace dynslam;
using interop::SemanticOcTree;

namespace {

struct TestScan {
  Eigen::Vector3f origin;
  std::vector<ScanPoint> points;
};

/// Scans from a camera that moves within a box of walls with a lump in it, with noise. Labels: 0 walls, 2
/// lump.
std::vector<TestScan> scans(test::Rng& rng, int count, int points, bool labels) {
  std::vector<TestScan> out;
  for (int k = 0; k < count; ++k) {
    TestScan scan;
    scan.origin = Eigen::Vector3f(0.11F * static_cast<float>(k), 0.05F * static_cast<float>(k % 3), 0.02F);
    for (int i = 0; i < points; ++i) {
      const Eigen::Vector3d d = Eigen::Vector3d(rng.normal(), rng.normal(), rng.normal() + 1.5).normalized();
      const bool lump = d.z() > 0.95;
      double t = 1.0;
      if (!lump) t = 1.8 / d.cwiseAbs().maxCoeff();
      t += 0.01 * rng.normal();
      const Eigen::Vector3f p = scan.origin + (t * d).cast<float>();
      scan.points.push_back(
          {p, static_cast<std::uint8_t>(labels && lump ? 2 : 0), {static_cast<std::uint8_t>(i), 7, 9}});
    }
    out.push_back(std::move(scan));
  }
  return out;
}

octomap::Pointcloud cloud(const TestScan& scan) {
  octomap::Pointcloud out;
  for (const auto& point : scan.points) out.push_back(point.p.x(), point.p.y(), point.p.z());
  return out;
}

void insert(SemanticOcTree& tree, const TestScan& scan, double max_range, bool discretize) {
  ScanVoxels voxels(tree.grid());
  gather_point_cloud(voxels, scan.points, scan.origin, max_range, discretize);
  tree.integrate(voxels);
}

SemanticOcTree mapped(const std::vector<TestScan>& all, double resolution) {
  SemanticOcTree tree(resolution);
  for (const TestScan& scan : all) insert(tree, scan, -1, true);
  return tree;
}

std::string bytes(const SemanticOcTree& tree) {
  std::ostringstream out;
  tree.writeData(out);
  return out.str();
}

}  // namespace

TEST_CASE("rays pass the voxels of OctoMap's computeRayKeys, in its order") {
  const octomap::OcTree tree(0.05);
  const VoxelGrid grid(0.05);
  test::Rng rng("octomap rays");
  octomap::KeyRay keys;
  for (int k = 0; k < 3000; ++k) {
    const Eigen::Vector3f a =
        Eigen::Vector3d(rng.uniform(-3, 3), rng.uniform(-3, 3), rng.uniform(-3, 3)).cast<float>();
    Eigen::Vector3f b =
        Eigen::Vector3d(rng.uniform(-3, 3), rng.uniform(-3, 3), rng.uniform(-3, 3)).cast<float>();
    if (k % 5 == 0) b.y() = a.y();  // along planes and axes, too
    if (k % 10 == 0) b.x() = a.x();
    if (k % 7 == 0) b = grid.centre(*grid.key(b)).cast<float>();
    REQUIRE(tree.computeRayKeys({a.x(), a.y(), a.z()}, {b.x(), b.y(), b.z()}, keys));
    std::vector<VoxelKey> expected, visited;
    for (const auto& key : keys) expected.push_back({{key[0], key[1], key[2]}});
    REQUIRE(traverse_ray(grid, a, b, [&](PackedKey key) { visited.push_back(unpack(key)); }));
    CHECK(visited == expected);
  }
}

TEST_CASE("fused scans give the tree of OctoMap's insertPointCloud, every node of it") {
  for (const bool discretize : {false, true}) {
    for (const double max_range : {-1.0, 1.9}) {
      for (const bool labels : {false, true}) {
        CAPTURE(discretize);
        CAPTURE(max_range);
        CAPTURE(labels);
        test::Rng rng("octomap equality");
        SemanticOcTree tree(0.05);
        octomap::OcTree oracle(0.05);
        for (const TestScan& scan : scans(rng, 7, 400, labels)) {
          insert(tree, scan, max_range, discretize);
          const Eigen::Vector3f& o = scan.origin;
          oracle.insertPointCloud(cloud(scan), {o.x(), o.y(), o.z()}, max_range, false, discretize);
          const auto same = test::compare_trees(tree, oracle);
          CHECK(same.first_fault == "");
          CHECK(same.largest_difference < 1e-6);
          CHECK(same.nodes >= tree.size());
          // Without labels even what is pruned is the same.
          if (!labels) CHECK(same.pruned_in_one == 0);
          if (!labels) CHECK(tree.size() == oracle.size());
        }
        CHECK(tree.size() > 5000);
        CHECK(tree.size() == tree.calcNumNodes());
        // Nothing was deferred for good: refreshing every inner node changes none.
        const std::string before = bytes(tree);
        tree.updateInnerOccupancy();
        CHECK(bytes(tree) == before);
      }
    }
  }
}

TEST_CASE("space that is passed again and again is pruned, and wakes up when something stands there") {
  SemanticOcTree tree(0.2);
  octomap::OcTree oracle(0.2);
  test::Rng rng("octomap prune");
  auto all = scans(rng, 1, 4000, false);
  TestScan intruder = all[0];
  for (auto& point : intruder.points) point.p = intruder.origin + 0.6F * (point.p - intruder.origin);
  for (int k = 0; k < 14; ++k) {
    const TestScan& scan = k >= 8 && k < 12 ? intruder : all[0];
    insert(tree, scan, -1, false);
    oracle.insertPointCloud(cloud(scan), {scan.origin.x(), scan.origin.y(), scan.origin.z()}, -1, false,
                            false);
    const auto same = test::compare_trees(tree, oracle);
    CHECK(same.first_fault == "");
    CHECK(same.largest_difference < 1e-6);
    CHECK(tree.size() == oracle.size());
  }
  int pruned = 0;
  for (auto it = tree.begin_leafs(), end = tree.end_leafs(); it != end; ++it)
    pruned += it.getDepth() < 16 ? 1 : 0;
  CHECK(pruned > 10);
}

TEST_CASE("the octree answers as the block map does, at every level") {
  test::Rng rng("tree and blocks");
  SemanticOcTree tree(0.1);
  VoxelBlockMap<float> blocks(tree.grid());
  interop::set_parameters(tree, blocks.params());
  ScanVoxels voxels(tree.grid());
  for (const TestScan& scan : scans(rng, 6, 500, true)) {
    gather_point_cloud(voxels, scan.points, scan.origin, -1, true);
    tree.integrate(voxels);
    blocks.integrate(voxels);
  }
  int occupied = 0;
  SemanticOcTree::Reader tree_states(tree);
  VoxelBlockMap<float>::Reader block_states(blocks);
  for (int k = 0; k < 3000; ++k) {
    const Eigen::Vector3d p(rng.uniform(-2.2, 2.8), rng.uniform(-2.2, 2.2), rng.uniform(-2.2, 2.2));
    for (const int level : {0, 1, 2, 4}) {
      const VoxelKey key = *tree.grid().key(p);
      CHECK(tree_states.state(key, level) == tree.at(key, level).state);
      CHECK(block_states.state(key, level) == blocks.at(key, level).state);
      const MapVoxel a = query_point(tree, p, level), b = query_point(blocks, p, level);
      CHECK(a.state == b.state);
      CHECK(static_cast<double>(a.log_odds) == doctest::Approx(static_cast<double>(b.log_odds)));
      if (a.state != Occupancy::occupied) continue;
      ++occupied;
      // Votes are scaled level by level, so a close decision may differ; a clear one must not.
      if (b.confidence > 0.6F) CHECK(a.label == b.label);
      if (level <= 1)
        CHECK(static_cast<double>(a.confidence) ==
              doctest::Approx(static_cast<double>(b.confidence)).epsilon(0.05));
    }
  }
  CHECK(occupied > 500);
  for (int k = 0; k < 30; ++k) {
    const Eigen::Vector3d p(rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1));
    const Eigen::Vector3d d(rng.normal(), rng.normal(), rng.normal());
    for (const int level : {0, 2}) {
      const auto a = cast_ray(tree, p, d, {.max_range = 3, .level = level}),
                 b = cast_ray(blocks, p, d, {.max_range = 3, .level = level});
      REQUIRE(a.ok());
      CHECK(a.status == b.status);
      CHECK(a.cell.centre == b.cell.centre);
      CHECK(a.unknown_cells == b.unknown_cells);
      const auto m = nearest_obstacle(tree, p, 1.5, level), n = nearest_obstacle(blocks, p, 1.5, level);
      REQUIRE(m.ok());
      CHECK(m.status == n.status);
      CHECK(m.cell.centre == n.cell.centre);
    }
  }
}

TEST_CASE("OctoMap's own queries and updates work, and carry labels to the parents") {
  test::Rng rng("octomap queries");
  SemanticOcTree tree = mapped(scans(rng, 5, 3000, true), 0.05);
  octomap::point3d end;
  REQUIRE(tree.castRay({0, 0, 0}, {0, 0, 1}, end, true, 3.0));
  const auto* node = tree.search(end);
  REQUIRE(node != nullptr);
  CHECK(tree.isNodeOccupied(node));
  CHECK(node->label() == 2);
  const auto hit = cast_ray(tree, {0, 0, 0}, {0, 0, 1}, {.max_range = 3.0});
  REQUIRE(hit.status == RayStatus::hit);
  CHECK((hit.cell.centre - Eigen::Vector3f(end.x(), end.y(), end.z()).cast<double>()).norm() < 1e-4);
  CHECK(tree.search(end, 14)->labelled());
  const float before = node->getLogOdds();
  tree.updateNode(end, std::numeric_limits<float>::quiet_NaN());
  CHECK(node->getLogOdds() == before);
  // Misses by OctoMap's updateNode: a voxel that becomes free forgets its label.
  for (int k = 0; k < 30; ++k) tree.updateNode(end, false);
  CHECK_FALSE(tree.isNodeOccupied(tree.search(end)));
  CHECK_FALSE(tree.search(end)->labelled());
}

TEST_CASE("pruning never merges different labels") {
  for (const bool different : {false, true}) {
    SemanticOcTree tree(0.1);
    ScanVoxels scan(tree.grid());
    for (int pass = 0; pass < 20; ++pass) {  // until every voxel is saturated
      scan.clear();
      for (int i = 0; i < 8; ++i) {
        const Eigen::Vector3f p(0.05F + 0.1F * static_cast<float>(i & 1),
                                0.05F + 0.1F * static_cast<float>(i >> 1 & 1),
                                0.05F + 0.1F * static_cast<float>(i >> 2));
        scan.add_end(p, different && i == 5 ? 3 : 2, {static_cast<std::uint8_t>(8 * i), 0, 0});
      }
      scan.finish();
      tree.integrate(scan);
    }
    tree.prune();
    CHECK(tree.getNumLeafNodes() == (different ? 8 : 1));
    CHECK(tree.search(0.15, 0.05, 0.15)->label() == (different ? 3 : 2));
    CHECK(tree.search(0.05, 0.05, 0.05)->label() == 2);
    CHECK(tree.search(0.05, 0.05, 0.05, 15)->label() == 2);
    // Expanding a pruned cell gives the parts its label and votes that do not grow.
    tree.expand();
    CHECK(tree.getNumLeafNodes() == 8);
    CHECK(tree.search(0.05, 0.05, 0.05)->labels().total() <= 20 * kVotesPerScan);
    const std::string before = bytes(tree);
    tree.prune();
    tree.expand();
    CHECK(bytes(tree) == before);
  }
}

TEST_CASE("the type is registered: OctoMap's factory reads it back, labels and all, byte for byte") {
  test::Rng rng("octomap file");
  const SemanticOcTree tree = mapped(scans(rng, 5, 2000, true), 0.05);
  std::stringstream file;
  REQUIRE(tree.write(file));
  const std::unique_ptr<octomap::AbstractOcTree> read(octomap::AbstractOcTree::read(file));
  const auto* same = dynamic_cast<const SemanticOcTree*>(read.get());
  REQUIRE(same != nullptr);
  CHECK(same->getResolution() == tree.getResolution());
  CHECK(same->size() == tree.size());
  CHECK(bytes(*same) == bytes(tree));
  CHECK(*same == tree);
}

TEST_CASE("a copy is deep and of the same type") {
  test::Rng rng("octomap copy");
  auto tree = std::make_unique<SemanticOcTree>(mapped(scans(rng, 2, 1000, true), 0.05));
  const SemanticOcTree copy(*tree);
  const std::string before = bytes(*tree);
  tree->clear();
  CHECK(bytes(copy) == before);
}

TEST_CASE("data cut short or changed never crash the reader nor leave half a tree") {
  test::Rng rng("octomap corrupt");
  SemanticOcTree small(0.2);
  insert(small, scans(rng, 1, 60, true)[0], -1, true);
  const std::string good = bytes(small);
  for (std::size_t n = 0; n < good.size(); n += 1 + n / 50) {
    std::istringstream in(good.substr(0, n));
    SemanticOcTree tree(0.2);
    tree.readData(in);
    CHECK(in.fail());
    CHECK(tree.size() == 0);
    CHECK(tree.getRoot() == nullptr);
  }
  int refused = 0;
  for (int k = 0; k < 2000; ++k) {
    std::string bad = good;
    for (int i = 0; i < 3; ++i) {
      bad[static_cast<std::size_t>(rng.integer(0, static_cast<int>(bad.size()) - 1))] =
          static_cast<char>(rng.integer(0, 255));
    }
    std::istringstream in(bad);
    SemanticOcTree tree(0.2);
    tree.readData(in);
    refused += in.fail() ? 1 : 0;
    CHECK((tree.size() == 0) == in.fail());
  }
  CHECK(refused > 500);
}

TEST_CASE("labels of 8 and above have their place in a tree, and survive its file") {
  // COCO has 80 classes: chair 56, tv 62.
  using Tree = interop::BasicSemanticOcTree<80>;
  Tree tree(0.1);
  BasicScanVoxels<80> scan(tree.grid());
  for (int k = 0; k < 3; ++k) {
    scan.clear();
    scan.add_end(Eigen::Vector3f(1.05F, 0.05F, 0.05F), 56, {10, 20, 30});
    scan.add_end(Eigen::Vector3f(2.05F, 0.05F, 0.05F), 62, {40, 50, 60});
    scan.add_end(Eigen::Vector3f(2.05F, 0.05F, 0.05F), 79, {40, 50, 60});
    scan.add_end(Eigen::Vector3f(2.05F, 0.05F, 0.05F), 62, {40, 50, 60});
    scan.carve(Eigen::Vector3f(0.05F, 0.05F, 0.05F), Eigen::Vector3f(2.05F, 0.05F, 0.05F));
    scan.finish();
    tree.integrate(scan);
  }
  CHECK(tree.getTreeType() == "SemanticOcTree80");
  CHECK(SemanticOcTree(0.1).getTreeType() == "SemanticOcTree");
  CHECK(query_point(tree, {1.05, 0.05, 0.05}).label == 56);
  CHECK(query_point(tree, {2.05, 0.05, 0.05}).label == 62);
  CHECK(tree.search(2.05, 0.05, 0.05)->labels().votes(79) > 0);
  std::stringstream file;
  REQUIRE(tree.write(file));
  const std::unique_ptr<octomap::AbstractOcTree> read(octomap::AbstractOcTree::read(file));
  const auto* same = dynamic_cast<const Tree*>(read.get());
  REQUIRE(same != nullptr);
  CHECK(*same == tree);
  CHECK(query_point(*same, {1.05, 0.05, 0.05}).label == 56);
  CHECK(cast_ray(*same, {0.05, 0.05, 0.05}, {1, 0, 0}, {.max_range = 5}).cell.voxel.label == 56);
}

TEST_CASE("few labels take few bytes; data of impossible labels are refused") {
  interop::BasicSemanticOcTree<4> tree(0.1);
  BasicScanVoxels<4> scan(tree.grid());
  scan.add_end(Eigen::Vector3f(0.05F, 0.05F, 0.05F), 3, {1, 2, 3});
  scan.add_end(Eigen::Vector3f(0.05F, 0.05F, 0.05F), 4, {1, 2, 3});  // no such label
  scan.finish();
  tree.integrate(scan);
  const auto* node = tree.search(0.05, 0.05, 0.05);
  CHECK(node->label() == 3);
  std::ostringstream out;
  node->writeData(out);
  std::string good = out.str();
  CHECK(good.size() == 4 + 1 + 1 + 3 + 1);
  interop::BasicSemanticOcTreeNode<4> back;
  std::istringstream in(good);
  CHECK(back.readData(in).good());
  CHECK(back == *node);
  good[4] = 1 << 4;
  std::istringstream bad(good);
  CHECK(back.readData(bad).fail());
  // Of many labels: an order that cannot be, a label that is none.
  interop::BasicSemanticOcTreeNode<80> many;
  for (const char* labels : {"\x01\x50\x03", "\x02\x05\x03\x05\x03", "\x01\x05\x00"}) {
    std::istringstream wrong(std::string(4, '\0') + std::string(labels, 3) + std::string(6, '\1'));
    CHECK(many.readData(wrong).fail());
  }
}
