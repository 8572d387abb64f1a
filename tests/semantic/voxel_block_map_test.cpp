// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/semantic/voxel_block_map.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <type_traits>
#include <vector>

#include "dynslam/semantic/map_query.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

template <std::size_t N>
using Labels = std::integral_constant<std::size_t, N>;

/// A few scans of random points around the origin, labels by octant.
std::vector<ScanVoxels> random_scans(const VoxelGrid& grid, test::Rng& rng, int count) {
  std::vector<ScanVoxels> scans;
  for (int k = 0; k < count; ++k) {
    ScanVoxels scan(grid);
    const Eigen::Vector3f origin(0.013F, 0.017F, 0.011F);
    for (int i = 0; i < 200; ++i) {
      const Eigen::Vector3d direction(rng.normal(), rng.normal(), rng.normal());
      const Eigen::Vector3f p = (direction.normalized() * rng.uniform(0.8, 1.2)).cast<float>();
      scan.add_end(p, p.x() > 0 ? 2 : 3, {1, 2, 3});
      scan.carve(origin, p);
    }
    scan.finish();
    scans.push_back(std::move(scan));
  }
  return scans;
}

}  // namespace

TEST_CASE_TEMPLATE("a reader gives the states that the map gives, from cell to cell", S, float, double) {
  const VoxelGrid grid(0.1);
  test::Rng rng("reader");
  VoxelBlockMap<S> map(grid);
  CHECK(typename VoxelBlockMap<S>::Reader(map).state(VoxelKey{}, 0) == Occupancy::unknown);
  for (const ScanVoxels& scan : random_scans(grid, rng, 5)) map.integrate(scan);
  typename VoxelBlockMap<S>::Reader reader(map);
  std::array<int, 3> seen{};
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  for (int k = 0; k < 20000; ++k) {
    // Steps to neighbours, and now and then elsewhere.
    p = k % 50 == 0 ? Eigen::Vector3d(rng.uniform(-9, 9), rng.uniform(-1.3, 1.3), rng.uniform(-1.3, 1.3))
                    : Eigen::Vector3d(p + 0.1 * Eigen::Vector3d(rng.uniform(-1, 1), rng.uniform(-1, 1),
                                                                rng.uniform(-1, 1)));
    if (k % 100 == 0) p.x() /= 8;
    const VoxelKey key = *grid.key(p);
    const int level = rng.integer(0, kVoxelLevels);
    const Occupancy state = reader.state(key, level);
    CHECK(state == map.at(key, level).state);
    ++seen[static_cast<std::size_t>(state)];
  }
  CHECK(*std::min_element(seen.begin(), seen.end()) > 200);
}

TEST_CASE_TEMPLATE("the block map fuses scans as single cells would (Eq 12)", S, float, double) {
  const VoxelGrid grid(0.1);
  test::Rng rng("block map");
  const auto scans = random_scans(grid, rng, 5);
  VoxelBlockMap<S> map(grid);
  std::map<VoxelKey, LogOddsCell<S>> cells;
  for (const ScanVoxels& scan : scans) {
    map.integrate(scan);
    for (const std::uint32_t b : scan.order()) {
      const ScanBlock& block = scan.block(b);
      for (std::size_t i = 0; i < 512; ++i) {
        const bool hit = (block.hit[i >> 6] >> (i & 63) & 1) != 0,
                   miss = (block.miss[i >> 6] >> (i & 63) & 1) != 0;
        if (!hit && !miss) continue;
        VoxelKey key = block.key();
        for (std::size_t a = 0; a < 3; ++a)
          key[a] = static_cast<std::uint16_t>(key[a] + ScanVoxels::offset_in_block(i)[a]);
        cells[key].update(hit ? map.params().hit : map.params().miss, map.params());
      }
    }
  }
  int occupied = 0;
  for (const auto& [key, cell] : cells) {
    const MapVoxel voxel = map.at(key);
    CHECK(voxel.state == cell.state(map.params()));
    CHECK(voxel.log_odds == doctest::Approx(static_cast<double>(cell.log_odds())));
    if (voxel.state != Occupancy::occupied) {
      CHECK(voxel.confidence == 0.0F);  // free space has no label
      continue;
    }
    ++occupied;
    if (grid.centre(key).x() > 0.1) CHECK(voxel.label == 2);
    if (grid.centre(key).x() < -0.1) CHECK(voxel.label == 3);
  }
  CHECK(occupied > 100);
  CHECK(map.at(VoxelKey{{0, 0, 0}}).state == Occupancy::unknown);
}

TEST_CASE("coarse cells are occupied where a part is, with the parts' label; unknown where all are") {
  const VoxelGrid grid(0.1);
  ScanVoxels scan(grid);
  scan.add_end(Eigen::Vector3f(1.05F, 0.05F, 0.05F), 2, {});
  scan.add_end(Eigen::Vector3f(1.15F, 0.05F, 0.05F), 2, {});
  scan.add_end(Eigen::Vector3f(1.05F, 0.15F, 0.05F), 3, {});
  scan.carve(Eigen::Vector3f(0.05F, 0.05F, 0.05F), Eigen::Vector3f(1.05F, 0.05F, 0.05F));
  scan.finish();
  VoxelBlockMap<float> map(grid);
  map.integrate(scan);
  CHECK(query_point(map, {1.05, 0.15, 0.05}).label == 3);
  const MapVoxel coarse = query_point(map, {1.05, 0.15, 0.05}, 2);
  CHECK(coarse.state == Occupancy::occupied);
  CHECK(coarse.label == 2);
  CHECK(coarse.confidence == doctest::Approx(2.0 / 3.0));
  CHECK(query_point(map, {0.35, 0.05, 0.05}, 1).state == Occupancy::free);
  CHECK(query_point(map, {0.35, 3.05, 0.05}, 3).state == Occupancy::unknown);
  CHECK(query_point(map, {1e9, 0, 0}).state == Occupancy::unknown);
  CHECK(query_point(map, {std::nan(""), 0, 0}).state == Occupancy::unknown);
}

TEST_CASE_TEMPLATE("the labels of COCO have their place in a map", N, Labels<4>, Labels<8>, Labels<80>) {
  constexpr std::size_t n = N::value;
  const VoxelGrid grid(0.1);
  BasicScanVoxels<n> scan(grid);
  std::vector<Eigen::Vector3f> places;
  for (std::size_t l = 0; l < n; ++l) {
    places.emplace_back(0.05F + 0.1F * static_cast<float>(l), 0.05F, 0.05F);
    scan.add_end(places.back(), static_cast<std::uint8_t>(l), {});
    scan.add_end(places.back(), 255, {});  // no such label: a sample without a vote
  }
  scan.finish();
  VoxelBlockMap<float, n> map(grid);
  map.integrate(scan);
  for (std::size_t l = 0; l < n; ++l) {
    CHECK(query_point(map, places[l]).label == l);
    CHECK(query_point(map, places[l]).confidence == 1.0F);
  }
  // A chair of 15 voxels beside a screen of one: a coarse cell is a chair.
  scan.clear();
  for (int k = 0; k < 16; ++k)
    scan.add_end(Eigen::Vector3f(4.05F + 0.1F * static_cast<float>(k % 4), 0.05F,
                                 0.05F + 0.1F * static_cast<float>(k / 4)),
                 static_cast<std::uint8_t>(k == 0 ? 2 : n - 1), {});
  scan.finish();
  VoxelBlockMap<double, n> other(grid);
  other.integrate(scan);
  for (const int level : {2, 3, 5, 9, 15})
    CHECK(query_point(other, {4.05, 0.05, 0.05}, level).label == n - 1);
}

TEST_CASE_TEMPLATE("coarse cells equal a look at each of their voxels, after every scan", S, float, double) {
  const VoxelGrid grid(0.1);
  test::Rng rng("coarse cells");
  VoxelBlockMap<S> map(grid);
  for (const ScanVoxels& scan : random_scans(grid, rng, 12)) {  // voxels sink, rise and lose their labels
    map.integrate(scan);
    for (int k = 0; k < 40; ++k) {
      const VoxelKey key =
          *grid.key(Eigen::Vector3d(rng.uniform(-1.6, 1.6), rng.uniform(-1.6, 1.6), rng.uniform(-1.6, 1.6)));
      for (const int level : {1, 2, 3, 4, 5, 6}) {
        MapVoxel expected;
        std::array<int, 2> votes{};  // of the labels 2 and 3; one of eight votes each scan
        const VoxelKey low = key_at_level(key, level);
        for (int z = 0; z < 1 << level; ++z) {
          for (int y = 0; y < 1 << level; ++y) {
            for (int x = 0; x < 1 << level; ++x) {
              const MapVoxel v =
                  map.at({{static_cast<std::uint16_t>(low[0] + x), static_cast<std::uint16_t>(low[1] + y),
                           static_cast<std::uint16_t>(low[2] + z)}});
              if (v.state == Occupancy::unknown) continue;
              expected.log_odds =
                  expected.state == Occupancy::unknown ? v.log_odds : std::max(expected.log_odds, v.log_odds);
              if (expected.state != Occupancy::occupied) expected.state = v.state;
              if (v.state == Occupancy::occupied) ++votes[v.label == 3 ? 1 : 0];
            }
          }
        }
        const MapVoxel coarse = map.at(key, level);
        CHECK(coarse.state == expected.state);
        CHECK(coarse.log_odds == expected.log_odds);
        if (coarse.state == Occupancy::occupied && (votes[0] == 0 || votes[1] == 0))
          CHECK(coarse.label == (votes[0] == 0 ? 3 : 2));
      }
    }
  }
  CHECK(map.at(VoxelKey{}, 16).state == Occupancy::occupied);  // the whole world
}
