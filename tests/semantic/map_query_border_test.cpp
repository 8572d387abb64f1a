// SPDX-License-Identifier: BSD-3-Clause
// What lies exactly at the end of what is asked about, against a look at every cell.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "dynslam/semantic/map_query.hpp"
#include "dynslam/semantic/scan_voxels.hpp"
#include "dynslam/semantic/voxel_block_map.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

/// Scalar and grid of queries at points that are numbers of that scalar, and such that are not.
template <class T>
struct Exact {
  using S = T;
  static constexpr double kEdge = 0.125;
};
struct Decimal {
  using S = double;
  static constexpr double kEdge = 0.1;
};

/// Occupied voxels here and there within so many of the origin, the others free.
void fill_cells(test::Rng& rng, const VoxelGrid& grid, VoxelBlockMap<float>& map, int reach) {
  ScanVoxels scan(grid);
  const auto middle = [&](int k) { return (k + 0.5) * grid.resolution(); };
  for (int z = -reach; z < reach; ++z) {
    for (int y = -reach; y < reach; ++y) {
      for (int x = -reach; x < reach; ++x) {
        const Eigen::Vector3d p(middle(x), middle(y), middle(z));
        if (rng.integer(0, 99) == 0) scan.add_end(p, 0, {});
        scan.carve(p, Eigen::Vector3d(middle(x + 1), middle(y), middle(z)));
      }
    }
  }
  scan.finish();
  map.integrate(scan);
}

/// Where a ray enters a cell and leaves it, from 0 on (slab method); enter > leave: it passes by.
std::pair<double, double> way_through(const Eigen::Vector3d& centre, double edge,
                                      const Eigen::Vector3d& origin, const Eigen::Vector3d& along) {
  double enter = 0, leave = std::numeric_limits<double>::infinity();
  for (Eigen::Index i = 0; i < 3; ++i) {
    const double low = centre(i) - edge / 2 - origin(i), high = low + edge;
    if (along(i) == 0) {
      if (low > 1e-9 || high < -1e-9) return {1, 0};
      continue;
    }
    enter = std::max(enter, std::min(low / along(i), high / along(i)));
    leave = std::min(leave, std::max(low / along(i), high / along(i)));
  }
  return {enter, leave};
}
/// Whether a ray runs within the plane of a face of a cell.
template <class D>
bool within_a_face(const Eigen::Vector3d& centre, double edge, const Eigen::MatrixBase<D>& origin,
                   const Eigen::Vector3d& along) {
  for (Eigen::Index i = 0; i < 3; ++i) {
    if (along(i) == 0 && std::abs(std::abs(double(origin(i)) - centre(i)) - edge / 2) < 1e-9) return true;
  }
  return false;
}

}  // namespace

TEST_CASE_TEMPLATE("what lies exactly at a radius, a box's side or the end of a ray is found", Query,
                   Exact<float>, Exact<double>, Decimal) {
  using Vector = Eigen::Matrix<typename Query::S, 3, 1>;
  constexpr double kNone = std::numeric_limits<double>::infinity(), kRounding = 1e-9;
  test::Rng rng("exactly there");
  const VoxelGrid grid(Query::kEdge);
  const double quarter = Query::kEdge / 4;  // all points and lengths are multiples of it
  VoxelBlockMap<float> map(grid);
  fill_cells(rng, grid, map, 7);
  const auto point = [&] {
    return Vector(Eigen::Vector3d(quarter * rng.integer(-40, 40), quarter * rng.integer(-40, 40),
                                  quarter * rng.integer(-40, 40))
                      .cast<typename Query::S>());
  };
  for (const int level : {0, 1, 2}) {
    std::vector<MapCell> all;
    const double inf = std::numeric_limits<double>::infinity();
    REQUIRE(query_box(map, {-inf, -inf, -inf}, {inf, inf, inf}, level,
                      [&](const MapCell& c) { all.push_back(c); }));
    REQUIRE(all.size() > 3);
    int at_radius = 0, at_side = 0, at_end = 0;
    for (int k = 0; k < 1500; ++k) {
      CAPTURE(k);
      const Vector p = point(), q = point();
      const double length = quarter * rng.integer(1, 30);
      double nearest = kNone;
      for (const auto& cell : all) nearest = std::min(nearest, distance_to_cell(p, cell.centre, cell.edge));
      const auto near = nearest_obstacle(map, p, length, level);
      CHECK(near.found() == (nearest <= length + kRounding));
      if (near.found()) CHECK(std::abs(near.cell.distance - nearest) < kRounding);
      at_radius += std::abs(nearest - length) < kRounding ? 1 : 0;

      const Vector low = p.cwiseMin(q), high = p.cwiseMax(q);
      std::size_t touching = 0, found = 0;
      for (const auto& cell : all) {
        const Eigen::Array3d apart = ((low + high) / 2).template cast<double>().array() - cell.centre.array();
        const double beside =
            (apart.abs() - ((high - low).template cast<double>().array() + cell.edge) / 2).maxCoeff();
        touching += beside <= kRounding ? 1 : 0;
        at_side += std::abs(beside) <= kRounding ? 1 : 0;
      }
      CHECK(query_box(map, low, high, level, [&](const auto&) { ++found; }));
      CHECK(found == touching);

      // Along the axes and in directions of whole lengths; what a ray only grazes is left to itself.
      Vector d = Vector::Zero();
      d(rng.integer(0, 2)) = typename Query::S(rng.integer(0, 1) == 0 ? 4 : -4);
      if (k % 2 == 0) d(rng.integer(0, 2)) = typename Query::S(rng.integer(0, 1) == 0 ? 3 : -3);
      const Eigen::Vector3d along = d.template cast<double>().normalized();
      double first = kNone;
      bool grazes = false;
      for (const auto& cell : all) {
        const auto [enter, leave] = way_through(cell.centre, cell.edge, p.template cast<double>(), along);
        if (leave < enter - kRounding || enter >= first + kRounding) continue;
        if (enter < first - kRounding) grazes = false;
        grazes = grazes || leave <= enter + kRounding || within_a_face(cell.centre, cell.edge, p, along);
        first = std::min(first, enter);
      }
      if (grazes || first < kRounding) continue;
      // Every third ray ends where the cell begins, up to the rounding of a decimal number.
      const double range = k % 3 == 0 && first < kNone ? std::round(first * 1e4) / 1e4 : length;
      const auto ray = cast_ray(map, p, d, {.max_range = range, .level = level});
      const bool reached = first <= range + kRounding;
      if (std::abs(first - range) < 1e-4 && std::abs(first - range) > kRounding) continue;
      CHECK(ray.status == (reached ? RayStatus::hit : RayStatus::free));
      if (reached) CHECK(std::abs(ray.distance - first) < kRounding);
      at_end += std::abs(first - range) < kRounding ? 1 : 0;
    }
    CHECK(at_radius > 5);
    CHECK(at_side > 50);
    CHECK(at_end > 2);
  }
}

TEST_CASE("a box beside the grid has nothing in it") {
  const VoxelGrid grid(0.1);
  ScanVoxels scan(grid);
  const double border = 3276.75;  // of the outermost cells
  scan.add_end(Eigen::Vector3d(border, 0.05, 0.05), 0, {});
  scan.add_end(Eigen::Vector3d(0.05, -border, 0.05), 0, {});
  scan.finish();
  VoxelBlockMap<double> map(grid);
  map.integrate(scan);
  const auto count = [&](const QueryVector& low, const QueryVector& high) {
    int n = 0;
    CHECK(query_box(map, low, high, 0, [&](const auto&) { ++n; }));
    return n;
  };
  const double inf = std::numeric_limits<double>::infinity();
  CHECK(count({4000, -1, -1}, {5000, 1, 1}) == 0);
  CHECK(count({-1, -inf, -1}, {1, -4000, 1}) == 0);
  CHECK(count({inf, -1, -1}, {inf, 1, 1}) == 0);
  CHECK(count({3000, -1, -1}, {5000, 1, 1}) == 1);
  CHECK(count({-inf, -inf, -inf}, {inf, inf, inf}) == 2);
}
