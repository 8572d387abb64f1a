// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/semantic/scan_voxels.hpp"

#include <doctest/doctest.h>

#include <Eigen/Geometry>

#include <cmath>
#include <limits>
#include <set>
#include <type_traits>
#include <vector>

#include "random.hpp"

using namespace dynslam;

namespace {

template <class S>
Eigen::Matrix<S, 3, 1> random_point(test::Rng& rng, double range) {
  return Eigen::Vector3d(rng.uniform(-range, range), rng.uniform(-range, range), rng.uniform(-range, range))
      .cast<S>();
}

/// All hit or missed voxels of a finished scan.
std::set<VoxelKey> voxels(const ScanVoxels& scan, bool hits) {
  std::set<VoxelKey> out;
  for (const std::uint32_t b : scan.order()) {
    const ScanBlock& block = scan.block(b);
    for (std::size_t i = 0; i < 512; ++i) {
      if (((hits ? block.hit : block.miss)[i >> 6] >> (i & 63) & 1) == 0) continue;
      const VoxelKey offset = ScanVoxels::offset_in_block(i);
      VoxelKey key = block.key();
      for (std::size_t a = 0; a < 3; ++a) key[a] = static_cast<std::uint16_t>(key[a] + offset[a]);
      out.insert(key);
    }
  }
  return out;
}

}  // namespace

TEST_CASE_TEMPLATE("a point's key is that of the voxel around it; outside and NaN there is none", S, float,
                   double) {
  const VoxelGrid grid(0.05);
  test::Rng rng("voxel key");
  for (int k = 0; k < 1000; ++k) {
    const auto p = random_point<S>(rng, 5.0);
    const auto key = grid.key(p);
    REQUIRE(key);
    const Eigen::Vector3d off = grid.centre(*key) - p.template cast<double>();
    CHECK(off.cwiseAbs().maxCoeff() <= 0.025 + 1e-9);
    CHECK(unpack(pack(*key)) == *key);
  }
  using V = Eigen::Matrix<S, 3, 1>;
  CHECK(grid.key(V(0, 0, 0)) == VoxelKey{{32768, 32768, 32768}});
  CHECK(grid.key(V(S(-0.01), 0, 0)) == VoxelKey{{32767, 32768, 32768}});
  CHECK_FALSE(grid.key(V(2000, 0, 0)));
  CHECK_FALSE(grid.key(V(0, -2000, 0)));
  CHECK_FALSE(grid.key(V(0, 0, std::numeric_limits<S>::quiet_NaN())));
  CHECK_FALSE(grid.key(V(std::numeric_limits<S>::infinity(), 0, 0)));
}

TEST_CASE("coarse cells hold their voxels; Morton codes follow the octree's path") {
  const VoxelGrid grid(0.1);
  test::Rng rng("voxel levels");
  for (int k = 0; k < 200; ++k) {
    const VoxelKey key = *grid.key(random_point<double>(rng, 50.0));
    std::uint64_t code = 0;
    for (int level = kVoxelLevels - 1; level >= 0; --level) {
      code = code << 3 | (key[0] >> level & 1U) | (key[1] >> level & 1U) << 1 | (key[2] >> level & 1U) << 2;
    }
    CHECK(morton_code(key) == code);
    for (int level = 0; level < 6; ++level) {
      const Eigen::Vector3d off = grid.centre(key, level) - grid.centre(key);
      CHECK(off.cwiseAbs().maxCoeff() <= grid.edge(level) / 2 - 0.05 + 1e-9);
    }
    const PackedKey packed = pack(key);
    const VoxelKey offset = ScanVoxels::offset_in_block(ScanVoxels::index_in_block(packed));
    for (std::size_t a = 0; a < 3; ++a) CHECK(offset[a] == (key[a] & 7));
  }
}

TEST_CASE_TEMPLATE("a ray visits face neighbours from its first voxel to the last but one", S, float,
                   double) {
  const VoxelGrid grid(0.05);
  test::Rng rng("ray");
  for (int k = 0; k < 500; ++k) {
    const auto a = random_point<S>(rng, 2.0), b = random_point<S>(rng, 2.0);
    std::vector<VoxelKey> visited;
    REQUIRE(traverse_ray(grid, a, b, [&](PackedKey key) { visited.push_back(unpack(key)); }));
    REQUIRE(!visited.empty());
    CHECK(visited.front() == *grid.key(a));
    const auto steps = [](const VoxelKey& p, const VoxelKey& q) {
      return std::abs(p[0] - q[0]) + std::abs(p[1] - q[1]) + std::abs(p[2] - q[2]);
    };
    for (std::size_t i = 1; i < visited.size(); ++i) CHECK(steps(visited[i - 1], visited[i]) == 1);
    CHECK(steps(visited.back(), *grid.key(b)) <= 2);  // 1, but for rounding at an edge
    for (const VoxelKey& key : visited) {             // and each one is near the segment
      const Eigen::Vector3d p = grid.centre(key), o = a.template cast<double>(),
                            d = (b - a).template cast<double>();
      CHECK((p - o).cross(d).norm() / d.norm() <= 0.05 * std::sqrt(3.0) / 2 + 1e-6);
    }
  }
  int count = 0;
  const Eigen::Matrix<S, 3, 1> p(S(0.01), S(0.01), S(0.01));
  CHECK(traverse_ray(grid, p, p, [&](PackedKey) { ++count; }));
  CHECK(count == 0);
  CHECK_FALSE(traverse_ray(grid, p, Eigen::Matrix<S, 3, 1>(S(1e6), 0, 0), [&](PackedKey) { ++count; }));
  CHECK(count == 0);
  CHECK(traverse_ray(grid, p, Eigen::Matrix<S, 3, 1>(S(1), 0, 0), [&](PackedKey) { return ++count < 3; }));
  CHECK(count == 3);  // a visitor may stop
}

TEST_CASE("each voxel of a scan is hit or missed once, and occupied wins") {
  const VoxelGrid grid(0.05);
  ScanVoxels scan(grid);
  test::Rng rng("scan");
  for (int repeat = 0; repeat < 3; ++repeat) {  // the memory is used again
    scan.clear();
    std::set<VoxelKey> ends, passed;
    const Eigen::Vector3f origin(0.01F, 0.02F, 0.03F);
    std::size_t samples = 0;
    for (int k = 0; k < 3000; ++k) {
      const auto p = random_point<float>(rng, 1.5);
      const bool first = ends.insert(*grid.key(p)).second;
      CHECK(scan.add_end(p, 2, {10, 20, 30}) == first);
      ++samples;
      scan.carve(origin, p);
      traverse_ray(grid, origin, p, [&](PackedKey key) { passed.insert(unpack(key)); });
    }
    scan.finish();
    for (const VoxelKey& key : ends) passed.erase(key);
    CHECK(voxels(scan, true) == ends);
    CHECK(voxels(scan, false) == passed);
    CHECK(scan.hits() == ends.size());
    CHECK(scan.misses() == passed.size());
    std::size_t counted = 0;
    std::uint64_t previous = 0;
    for (const std::uint32_t b : scan.order()) {
      const std::uint64_t code = morton_code(scan.block(b).key());
      CHECK((previous == 0 || previous < code));
      previous = code;
      for (std::size_t i = 0; i < 512; ++i) {
        if ((scan.block(b).hit[i >> 6] >> (i & 63) & 1) != 0) counted += scan.end(scan.block(b), i).samples;
      }
    }
    CHECK(counted == samples);
  }
}

TEST_CASE("a scan's votes are shared by the labels of its pixels; its colour is the mean") {
  ScanVoxels scan{VoxelGrid(0.1)};
  const Eigen::Vector3f p(0.05F, 0.05F, 0.05F);
  for (int k = 0; k < 6; ++k) scan.add_end(p, 3, {100, 0, 0}, 0.5F);
  for (int k = 0; k < 2; ++k) scan.add_end(p, 1, {20, 8, 0}, 0.25F);
  scan.add_end(Eigen::Vector3f(5, 5, 5), 200, {1, 2, 3});  // no such label: no vote
  scan.finish();
  REQUIRE(scan.hits() == 2);
  for (const std::uint32_t b : scan.order()) {
    for (std::size_t i = 0; i < 512; ++i) {
      if ((scan.block(b).hit[i >> 6] >> (i & 63) & 1) == 0) continue;
      const VoxelEnd& end = scan.end(scan.block(b), i);
      MapLabels labels;
      end.vote(labels);
      if (end.samples == 8) {
        CHECK(labels.votes(3) == 6);
        CHECK(labels.votes(1) == 2);
        CHECK(end.weight == 0.5F);
        CHECK(end.colour() == std::array<std::uint8_t, 3>{80, 2, 0});
      } else {
        CHECK(labels.empty());
      }
    }
  }
}

TEST_CASE("of many rays that end in one voxel carve_once follows the first") {
  ScanVoxels scan{VoxelGrid(0.1)};
  const Eigen::Vector3f origin(0.05F, 0.05F, 0.05F), end(2.05F, 0.05F, 0.05F);
  CHECK(scan.carve_once(origin, end));
  CHECK(scan.carve_once(Eigen::Vector3f(0.05F, 1.05F, 0.05F), end));
  scan.finish();
  CHECK(scan.misses() == 20);
}

TEST_CASE_TEMPLATE("points may be expressions, and those of ints or mixed scalars are refused", S, float,
                   double) {
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  const Vector3 origin(S(0.05), S(0.05), S(0.05)), step(S(0.5), S(0), S(0));
  const VoxelGrid grid(0.1);
  ScanVoxels scan(grid), plain(grid);
  const Vector3 end = origin + 2 * step;
  CHECK(plain.add_end(end, 1, {}));
  CHECK(plain.carve(origin, end));
  CHECK(scan.add_end(origin + 2 * step, 1, {}));
  CHECK(scan.carve(origin, 2 * step + origin));
  CHECK(scan.carve_once(origin + S(0) * step, origin + 2 * step));
  plain.finish();
  scan.finish();
  CHECK(scan.hits() == plain.hits());
  CHECK(scan.misses() == plain.misses());
  int count = 0;
  const auto visit = [&](PackedKey) { ++count; };
  CHECK(traverse_ray(grid, origin + S(0) * step, (origin + step).eval(), visit));
  CHECK(count == 5);
  using Other = std::conditional_t<std::is_same_v<S, float>, Eigen::Vector3d, Eigen::Vector3f>;
  const auto takes = [&](const auto& a, const auto& b) {
    return requires {
      traverse_ray(grid, a, b, visit);
    };
  };
  CHECK(takes(origin, end));
  CHECK_FALSE(takes(origin, Other(0, 0, 0)));
  CHECK_FALSE(takes(Eigen::Vector3i(0, 0, 0), Eigen::Vector3i(0, 0, 0)));
}
