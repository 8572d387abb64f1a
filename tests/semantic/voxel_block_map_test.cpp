// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/semantic/voxel_block_map.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <map>
#include <optional>
#include <vector>

#include "dynslam/semantic/map_query.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

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

TEST_CASE("box, ray and nearest obstacle agree with a search through everything") {
  const VoxelGrid grid(0.1);
  test::Rng rng("map query");
  VoxelBlockMap<float> map(grid);
  for (const ScanVoxels& scan : random_scans(grid, rng, 4)) map.integrate(scan);
  std::vector<MapCell> all;
  query_box(map, {-3, -3, -3}, {3, 3, 3}, 0, [&](const MapCell& cell) { all.push_back(cell); });
  REQUIRE(all.size() > 100);
  for (int k = 0; k < 50; ++k) {
    const Eigen::Vector3d p(rng.uniform(-2, 2), rng.uniform(-2, 2), rng.uniform(-2, 2));
    const double radius = rng.uniform(0.1, 1.5);
    double best = radius;
    bool any = false;
    for (const MapCell& cell : all) {
      const double d = distance_to_cell(p, cell.centre, cell.edge);
      if (d <= best) {
        best = d;
        any = true;
      }
    }
    const auto nearest = nearest_obstacle(map, p, radius);
    REQUIRE(nearest.has_value() == any);
    if (any) CHECK(nearest->distance == doctest::Approx(best).epsilon(1e-9));

    std::size_t inside = 0, found = 0;
    const Eigen::Vector3d low = p - Eigen::Vector3d::Constant(0.42),
                          high = p + Eigen::Vector3d::Constant(0.27);
    for (const MapCell& cell : all) {
      const bool touches =
          ((cell.centre.array() + 0.05 > low.array()) && (cell.centre.array() - 0.05 <= high.array())).all();
      inside += touches ? 1 : 0;
    }
    query_box(map, low, high, 0, [&](const MapCell&) { ++found; });
    CHECK(found == inside);

    // A ray: march in small steps.
    const Eigen::Vector3d direction = Eigen::Vector3d(rng.normal(), rng.normal(), rng.normal()).normalized();
    const Eigen::Vector3d origin(0.013, 0.017, 0.011);
    std::optional<double> marched;
    for (double t = 0; t < 3 && !marched; t += 1e-4) {
      if (query_point(map, origin + t * direction).state == Occupancy::occupied) marched = t;
    }
    const auto hit = cast_ray(map, origin, 2.5 * direction, 3.0);
    REQUIRE(hit.has_value() == marched.has_value());
    if (hit) {
      CHECK(hit->distance == doctest::Approx(*marched).epsilon(1e-3));
      CHECK((hit->cell.voxel.label == 2 || hit->cell.voxel.label == 3));
    }
  }
  CHECK_FALSE(cast_ray(map, {0, 0, 0}, {0, 0, 0}, 3.0));
  const auto far = cast_ray(map, {0, 0, 0}, {0, 0, 1}, 1e12);  // far beyond the grid
  const auto near = cast_ray(map, {0, 0, 0}, {0, 0, 1}, 3.0);
  CHECK(far.has_value() == near.has_value());
  const auto blind = cast_ray(map, {2.5, 2.5, 2.5}, {1, 0, 0}, 1.0, true);
  REQUIRE(blind);
  CHECK(blind->unknown);
  CHECK(blind->distance < 1e-12);
  CHECK_FALSE(cast_ray(map, {2.5, 2.5, 2.5}, {1, 0, 0}, 1.0));
}
