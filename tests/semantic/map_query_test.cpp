// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/semantic/map_query.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <vector>

#include "dynslam/semantic/scan_voxels.hpp"
#include "dynslam/semantic/voxel_block_map.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

/// A store of another project: a sorted list of voxels with heights, and nothing that VoxelMap does not name.
class ListMap {
 public:
  using Key = VoxelKey;
  struct Voxel {
    Occupancy state = Occupancy::unknown;
    double temperature = 0;  // whatever its owner keeps
  };

  explicit ListMap(double edge) : grid_(edge) {}
  void set(const VoxelKey& key, Occupancy state, double temperature) { voxels_[key] = {state, temperature}; }
  [[nodiscard]] VoxelGrid grid() const { return grid_; }
  [[nodiscard]] Voxel at(const VoxelKey& key, int level) const {
    Voxel out;
    for (const auto& [k, voxel] : voxels_) {
      if (key_at_level(k, level) != key_at_level(key, level)) continue;
      if (out.state != Occupancy::occupied) out = voxel;
    }
    return out;
  }
  template <class F>
  void for_each_occupied(const VoxelKey& low, const VoxelKey& high, int level, const F& f) const {
    std::map<VoxelKey, Voxel> cells;
    for (const auto& [k, voxel] : voxels_)
      if (voxel.state == Occupancy::occupied) cells.emplace(key_at_level(k, level), voxel);
    for (const auto& [cell, voxel] : cells) {
      bool touches = true;
      for (std::size_t a = 0; a < 3; ++a)
        touches = touches && cell[a] <= high[a] && int(cell[a]) + (1 << level) > int(low[a]);
      if (touches) f(cell, voxel);
    }
  }

 private:
  VoxelGrid grid_;
  std::map<VoxelKey, Voxel> voxels_;
};
static_assert(VoxelMap<ListMap> && !VoxelStore<ListMap>);

struct NoGrid {
  using Key = VoxelKey;
  using Voxel = ListMap::Voxel;
  [[nodiscard]] Voxel at(const VoxelKey&, int) const { return {}; }
};
static_assert(!VoxelMap<NoGrid> && !VoxelMap<int>);

/// Clusters of occupied voxels far apart, in free surroundings.
void fill(test::Rng& rng, const VoxelGrid& grid, VoxelBlockMap<float>& map, int clusters, int voxels,
          double spread) {
  ScanVoxels scan(grid);
  for (int c = 0; c < clusters; ++c) {
    const Eigen::Vector3d centre(rng.uniform(-spread, spread), rng.uniform(-spread, spread),
                                 rng.uniform(-spread, spread));
    for (int i = 0; i < voxels; ++i) {
      const Eigen::Vector3d p = centre + 0.5 * Eigen::Vector3d(rng.normal(), rng.normal(), rng.normal());
      scan.add_end(p, static_cast<std::uint8_t>(c % 8), {});
      scan.carve(Eigen::Vector3d(p + Eigen::Vector3d(0.4, 0.3, 0.2)), p);
    }
  }
  scan.finish();
  map.integrate(scan);
}

template <VoxelMap M>
std::vector<MapCellOf<M>> everything(const M& map, int level) {
  std::vector<MapCellOf<M>> all;
  const double far = std::numeric_limits<double>::infinity();
  CHECK(query_box(map, {-far, -far, -far}, {far, far, far}, level,
                  [&](const auto& cell) { all.push_back(cell); }));
  return all;
}

}  // namespace

TEST_CASE_TEMPLATE("nearest obstacle equals a search through everything, near and far, at every level", S,
                   float, double) {
  test::Rng rng("nearest");
  const VoxelGrid grid(0.1);
  for (const double spread : {0.5, 20.0, 1500.0}) {
    VoxelBlockMap<float> map(grid);
    fill(rng, grid, map, 6, 12, spread);
    for (const int level : {0, 1, 3, 6}) {
      const auto all = everything(map, level);
      REQUIRE(!all.empty());
      for (int k = 0; k < 60; ++k) {
        const double range = k % 3 == 0 ? 3 * spread : spread;
        const Eigen::Matrix<S, 3, 1> p =
            Eigen::Vector3d(rng.uniform(-range, range), rng.uniform(-range, range),
                            rng.uniform(-range, range))
                .cast<S>();
        const double radius =
            k % 5 == 0 ? std::numeric_limits<double>::infinity() : rng.uniform(0, 2 * spread);
        const MapCellOf<VoxelBlockMap<float>>* best = nullptr;
        double distance = radius;
        for (const auto& cell : all) {
          const double d = distance_to_cell(p, cell.centre, cell.edge);
          const bool tie = best != nullptr && d == distance &&
                           std::lexicographical_compare(cell.centre.begin(), cell.centre.end(),
                                                        best->centre.begin(), best->centre.end());
          if ((best == nullptr && d <= distance) || d < distance || tie) {
            best = &cell;
            distance = d;
          }
        }
        const auto nearest = nearest_obstacle(map, p, radius, level);
        REQUIRE(nearest.ok());
        REQUIRE(nearest.found() == (best != nullptr));
        if (best == nullptr) continue;
        CHECK(nearest.cell.distance == distance);
        CHECK(nearest.cell.centre == best->centre);
        CHECK(nearest.cell.voxel == best->voxel);
      }
    }
  }
}

TEST_CASE_TEMPLATE("box and ray agree with a search through everything", S, float, double) {
  using Vector = Eigen::Matrix<S, 3, 1>;
  const VoxelGrid grid(0.1);
  test::Rng rng("map query");
  VoxelBlockMap<float> map(grid);
  fill(rng, grid, map, 8, 60, 1.0);
  const auto all = everything(map, 0);
  REQUIRE(all.size() > 100);
  int hits = 0;
  for (int k = 0; k < 50; ++k) {
    const Vector p = Eigen::Vector3d(rng.uniform(-2, 2), rng.uniform(-2, 2), rng.uniform(-2, 2)).cast<S>();
    std::size_t inside = 0, found = 0;
    const Vector low = p - Vector::Constant(S(0.42)), high = p + Vector::Constant(S(0.27));
    for (const auto& cell : all) {
      const bool touches = ((cell.centre.array() + 0.05 > low.template cast<double>().array()) &&
                            (cell.centre.array() - 0.05 <= high.template cast<double>().array()))
                               .all();
      inside += touches ? 1 : 0;
    }
    query_box(map, low, high, 0, [&](const auto&) { ++found; });
    CHECK(found == inside);

    // A ray: march in small steps.
    const Vector direction = Eigen::Vector3d(rng.normal(), rng.normal(), rng.normal()).normalized().cast<S>();
    const Vector origin(S(0.013), S(0.017), S(0.011));
    std::optional<double> marched;
    for (double t = 0; t < 3 && !marched; t += 1e-4) {
      if (query_point(map, Vector(origin + S(t) * direction)).state == Occupancy::occupied) marched = t;
    }
    const auto hit = cast_ray(map, origin, S(2.5) * direction, {.max_range = 3.0});
    REQUIRE(hit.status == (marched ? RayStatus::hit : RayStatus::free));
    if (!marched) CHECK(hit.distance == 3.0);
    if (!marched) continue;
    ++hits;
    CHECK(hit.distance == doctest::Approx(*marched).epsilon(1e-3));
    CHECK(hit.cell.voxel.state == Occupancy::occupied);
  }
  CHECK(hits > 5);
}

TEST_CASE("a ray from NaN, from outside or in no direction is no free way") {
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  const VoxelGrid grid(0.1);
  test::Rng rng("bad rays");
  VoxelBlockMap<float> map(grid);
  fill(rng, grid, map, 4, 50, 1.0);
  const RayOptions near{.max_range = 3};
  for (const auto& result :
       {cast_ray(map, {nan, 0, 0}, {0, 0, 1}, near), cast_ray(map, {0, 0, 0}, {0, nan, 1}, near),
        cast_ray(map, {0, 0, 0}, {0, 0, 0}, near), cast_ray(map, {0, 0, 0}, {inf, 0, 0}, near),
        cast_ray(map, {0, 0, 0}, {0, 0, 1}, {.max_range = nan}),
        cast_ray(map, {0, 0, 0}, {0, 0, 1}, {.max_range = 0}), cast_ray(map, {0, 0, 0}, {0, 0, 1}, {}),
        cast_ray(map, {0, 0, 0}, {0, 0, 1}, {.max_range = 3, .level = 16}),
        cast_ray(map, {0, 0, 0}, {0, 0, 1}, {.max_range = 3, .level = -1})}) {
    CHECK(result.status == RayStatus::bad_input);
    CHECK_FALSE(result.ok());
    CHECK_FALSE(result.blocked());
  }
  CHECK(cast_ray(map, {1e9, 0, 0}, {-1, 0, 0}, near).status == RayStatus::outside_grid);
  CHECK(cast_ray(map, {inf, 0, 0}, {-1, 0, 0}, near).status == RayStatus::outside_grid);
  CHECK_FALSE(cast_ray(map, {1e9, 0, 0}, {-1, 0, 0}, near).ok());

  CHECK(nearest_obstacle(map, {nan, 0, 0}, 1.0).status == NearestStatus::bad_input);
  CHECK(nearest_obstacle(map, {0, 0, 0}, nan).status == NearestStatus::bad_input);
  CHECK(nearest_obstacle(map, {0, 0, 0}, 1.0, 16).status == NearestStatus::bad_input);
  CHECK(nearest_obstacle(map, {1e9, 0, 0}, 1.0).status == NearestStatus::none);
  CHECK_FALSE(query_box(map, {nan, 0, 0}, {1, 1, 1}, 0, [](const auto&) {}));
  CHECK(query_point(map, {nan, 0, 0}).state == Occupancy::unknown);
  CHECK(query_point(map, {1e9, 0, 0}).state == Occupancy::unknown);
  CHECK(query_point(map, {0, 0, 0}, 99).state == Occupancy::unknown);
}

TEST_CASE("unknown space ends a careful ray and is counted on any other one") {
  const VoxelGrid grid(0.1);
  ScanVoxels scan(grid);
  scan.carve(Eigen::Vector3f(0.05F, 0.05F, 0.05F), Eigen::Vector3f(1.05F, 0.05F, 0.05F));  // 10 voxels
  scan.add_end(Eigen::Vector3f(2.05F, 0.05F, 0.05F), 2, {});
  scan.finish();
  VoxelBlockMap<double> map(grid);
  map.integrate(scan);
  const auto careful =
      cast_ray(map, {0.05, 0.05, 0.05}, {1, 0, 0}, {.max_range = 5, .stop_at_unknown = true});
  CHECK(careful.status == RayStatus::unknown);
  CHECK(careful.blocked());
  CHECK(careful.distance == doctest::Approx(0.95));
  const auto bold = cast_ray(map, {0.05, 0.05, 0.05}, {1, 0, 0}, {.max_range = 5});
  CHECK(bold.status == RayStatus::hit);
  CHECK(bold.distance == doctest::Approx(1.95));
  CHECK(bold.unknown_cells == 10);
  const auto known = cast_ray(map, {0.05, 0.05, 0.05}, {1, 0, 0}, {.max_range = 0.8});
  CHECK(known.status == RayStatus::free);
  CHECK(known.unknown_cells == 0);
  const auto nothing = cast_ray(map, {0.05, 3.05, 0.05}, {1, 0, 0}, {.max_range = 0.8});
  CHECK(nothing.status == RayStatus::free);
  CHECK(nothing.unknown_cells == 9);  // free only as far as nothing is known
  // To the border of the grid, 3276.75 m away, and no farther.
  const auto border =
      cast_ray(map, {0.05, 0.05, 0.05}, {0, 1, 0}, {.max_range = std::numeric_limits<double>::infinity()});
  CHECK(border.status == RayStatus::free);
  CHECK(border.distance == doctest::Approx(3276.70));
  const auto inside = cast_ray(map, {2.02, 0.03, 0.05}, {1, 0, 0}, {.max_range = 1});
  CHECK(inside.status == RayStatus::hit);
  CHECK(inside.distance == 0);
  for (const int level : {1, 4, 11, 15}) {
    const auto coarse = cast_ray(map, {-0.05, 0.05, 0.05}, {1, 0, 0}, {.max_range = 3000, .level = level});
    CHECK(coarse.status == RayStatus::hit);
    CHECK(coarse.cell.edge == grid.edge(level));
  }
}

TEST_CASE("every query works on a store that names nothing but VoxelMap") {
  test::Rng rng("list map");
  ListMap map(0.25);
  std::vector<Eigen::Vector3d> occupied;
  for (int k = 0; k < 40; ++k) {
    const Eigen::Vector3d p(rng.uniform(-4, 4), rng.uniform(-4, 4), rng.uniform(-4, 4));
    map.set(*map.grid().key(p), k % 4 == 0 ? Occupancy::free : Occupancy::occupied, 20.0 + k);
    if (k % 4 != 0) occupied.push_back(map.grid().centre(*map.grid().key(p)));
  }
  CHECK(query_point(map, occupied[0]).temperature > 20);
  CHECK(query_point(map, occupied[0], 3).state == Occupancy::occupied);
  CHECK(everything(map, 0).size() == occupied.size());
  for (int k = 0; k < 20; ++k) {
    const Eigen::Vector3d p(rng.uniform(-5, 5), rng.uniform(-5, 5), rng.uniform(-5, 5));
    double best = 1e9;
    for (const auto& centre : occupied) best = std::min(best, distance_to_cell(p, centre, 0.25));
    const auto nearest = nearest_obstacle(map, p, 20.0);
    REQUIRE(nearest.found());
    CHECK(nearest.cell.distance == best);
    const Eigen::Vector3d target = occupied[std::size_t(k) % occupied.size()];
    const auto hit = cast_ray(map, p, target - p, {.max_range = 20});
    REQUIRE(hit.status == RayStatus::hit);
    CHECK(hit.distance <= (target - p).norm());
    CHECK(hit.cell.voxel.temperature > 20);
  }
}
