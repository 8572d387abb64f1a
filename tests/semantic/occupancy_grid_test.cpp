// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/semantic/occupancy_grid.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>

#include "dynslam/semantic/voxel_block_map.hpp"
#include "painted_map.hpp"

using namespace dynslam;

namespace {

constexpr std::uint8_t kPerson = 1, kChair = 2;

/// A room, z up from its floor: x to 3 m with a wall behind, y to 2 m; what stands in it, by its height.
test::Paint room(const Eigen::Vector3d& p) {
  const auto within = [&](double x0, double x1, double y0, double y1, double z0, double z1) {
    return p.x() >= x0 && p.x() <= x1 && p.y() >= y0 && p.y() <= y1 && p.z() >= z0 && p.z() <= z1;
  };
  if (!within(0, 3, 0, 2, -0.1, 2.5)) return {};
  if (p.z() < 0) return {Occupancy::occupied};                                    // the floor
  if (within(2.8, 3, 0, 2, 0, 2.5)) return {Occupancy::occupied};                 // the wall
  if (within(1, 1.4, 1, 1.4, 0.6, 0.7)) return {Occupancy::occupied, kChair};     // a seat,
  if (within(1, 1.4, 1, 1.4, 0, 0.6)) return {};                                  // under which nobody looked
  if (within(0.4, 0.7, 1.4, 1.7, 0, 1.7)) return {Occupancy::occupied, kPerson};  // a person
  if (within(2, 2.4, 0.4, 0.8, 2, 2.1)) return {Occupancy::occupied};             // a lamp, above the band
  if (within(1.8, 2.6, 1.4, 1.8, 0, 0.9)) return {};  // behind something: only the air above was seen
  return {Occupancy::free};
}

Occupancy state_at(const OccupancyGridResult& grid, double x, double y) {
  const int u = static_cast<int>(std::floor((x - grid.corner.x()) / grid.cell)),
            v = static_cast<int>(std::floor((y - grid.corner.y()) / grid.cell));
  return grid.cells.contains(u, v) ? grid.cells(u, v) : Occupancy::unknown;
}

/// The room in a map whose axes are others.
VoxelBlockMap<float> map_of_room(const SE3<double>& T_ground_map) {
  VoxelBlockMap<float> map{VoxelGrid(0.05)};
  test::paint_map(map, {-5, -5, -5}, {5, 5, 5},
                  [&](const Eigen::Vector3d& p) { return room(T_ground_map * p); });
  return map;
}

}  // namespace

TEST_CASE("a grid tells walls, free ground and what nobody has seen, whichever way the map lies") {
  const SE3<double> straight(SO3<double>(), Eigen::Vector3d(0.02, 0.01, 0.03)),
      camera(SO3<double>::exp(Eigen::Vector3d(-1.9, 0.2, -0.3)), Eigen::Vector3d(1.5, 1, 1.2));
  for (const SE3<double>& T : {straight, camera}) {
    const auto map = map_of_room(T);
    const auto grid =
        occupancy_grid(map, T, {}, [](const MapVoxel& voxel) { return voxel.label != kPerson; });
    REQUIRE(grid.ok());
    CHECK(grid.cell == 0.05);
    CHECK(state_at(grid, 0.8, 0.5) == Occupancy::free);
    CHECK(state_at(grid, 2.2, 0.6) == Occupancy::free);       // under the lamp
    CHECK(state_at(grid, 1.2, 1.2) == Occupancy::occupied);   // the seat
    CHECK(state_at(grid, 0.55, 1.55) == Occupancy::unknown);  // the person, whatever is behind
    CHECK(state_at(grid, 2.2, 1.6) == Occupancy::unknown);    // of which the lower part was not seen
    CHECK(state_at(grid, 3.5, 1) == Occupancy::unknown);
    for (double y = 0.1; y < 1.9; y += 0.01) {
      CAPTURE(y);
      CHECK(state_at(grid, 2.9, y) == Occupancy::occupied);  // a wall without a hole
    }
    // The box of what was seen in the band, and no more than a cell's rounding beyond.
    CHECK(grid.corner.x() == doctest::Approx(0).epsilon(0.11));
    CHECK(grid.corner.y() == doctest::Approx(0).epsilon(0.11));
    CHECK(grid.cells.width() * grid.cell == doctest::Approx(3).epsilon(0.08));
    CHECK(grid.cells.height() * grid.cell == doctest::Approx(2).epsilon(0.12));
    // Everything is an obstacle unless the options say otherwise; or chairs alone are.
    CHECK(state_at(occupancy_grid(map, T), 0.55, 1.55) == Occupancy::occupied);
    const auto chairs =
        occupancy_grid(map, T, {}, [](const MapVoxel& voxel) { return voxel.label == kChair; });
    CHECK(state_at(chairs, 1.2, 1.2) == Occupancy::occupied);
    CHECK(state_at(chairs, 2.9, 1) != Occupancy::occupied);
  }
}

TEST_CASE("the band of heights and the cell's size are the caller's") {
  const SE3<double> T;
  const auto map = map_of_room(T);
  const auto all = occupancy_grid(map, T, {.cell = 0.2, .low = 0.1, .high = 2.3});
  CHECK(state_at(all, 2.2, 0.6) == Occupancy::occupied);  // the lamp
  CHECK(all.cells.width() == 15);
  CHECK(all.cells.height() == 10);
  const auto low = occupancy_grid(map, T, {.low = 0.1, .high = 0.5});
  CHECK(state_at(low, 1.2, 1.2) == Occupancy::unknown);  // below the seat
  CHECK(state_at(low, 2.9, 1) == Occupancy::occupied);
  const auto fine = occupancy_grid(map, T, {.cell = 0.0125});
  for (double x = 2.81; x < 2.99; x += 0.01) CHECK(state_at(fine, x, 1.01) == Occupancy::occupied);
  // What was seen at head height alone is enough for those who say so.
  CHECK(state_at(occupancy_grid(map, T, {.clear = 1.7, .clear_share = 0.2}), 2.2, 1.6) == Occupancy::free);
}

TEST_CASE("grids that cannot be are told apart") {
  const SE3<double> T;
  const auto map = map_of_room(T);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK(occupancy_grid(map, T, {.low = 1, .high = 1}).status == GridStatus::bad_input);
  CHECK(occupancy_grid(map, T, {.low = nan}).status == GridStatus::bad_input);
  CHECK(occupancy_grid(map, T, {.cell = -1}).status == GridStatus::bad_input);
  CHECK(occupancy_grid(map, T, {.cell = 1e-9}).status == GridStatus::bad_input);
  CHECK(occupancy_grid(map, T, {.low = 5, .high = 6}).status == GridStatus::nothing_in_band);
  CHECK(occupancy_grid(map, T, {.max_cells = 100}).status == GridStatus::too_many_cells);
  const VoxelBlockMap<float> empty{VoxelGrid(0.05)};
  CHECK(occupancy_grid(empty, T).status == GridStatus::nothing_in_band);
}
