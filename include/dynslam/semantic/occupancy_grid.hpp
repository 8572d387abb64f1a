// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <limits>

#include "dynslam/concepts/map.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/semantic/log_odds.hpp"
#include "dynslam/semantic/map_query.hpp"
#include "dynslam/semantic/voxel_key.hpp"

// A map of voxels seen from above, for planners in the plane: which cells of the ground a robot can use.

namespace dynslam {

/// Options of occupancy_grid. Heights are above the ground.
struct OccupancyGridOptions {
  double cell = 0;    ///< edge of a cell [m], at least a quarter of a voxel's; 0: that of a voxel
  double low = 0.1;   ///< lower end of the band in which voxels are obstacles [m]: above the floor's noise
  double high = 1.8;  ///< upper end [m]: the robot's height; doorways and lamps are above it
  /// Lowest part of the band that has to be seen free [m]: where only the air at head height was seen there
  /// may be a box on the floor.
  double clear = 0.4;
  double clear_share = 0.5;  ///< of that part: grazing rays leave some of the voxels over a floor out
  std::int64_t max_cells = 100'000'000;  ///< a single voxel far away must not fill the memory
};

/// What became of a grid.
enum class GridStatus : std::uint8_t {
  ok,
  nothing_in_band,  ///< no voxel in the band of heights was observed
  too_many_cells,   ///< more than max_cells
  bad_input         ///< a length that is none, or no band: low is not below high
};

/// Cells of the ground.
struct OccupancyGridResult {
  GridStatus status = GridStatus::bad_input;
  double cell = 0;  ///< edge [m]
  Eigen::Vector2d corner =
      Eigen::Vector2d::Zero();  ///< lowest x and y of the grid [m], in the ground's frame
  /// States; cell (u, v) covers corner + cell * [u, u + 1] x [v, v + 1]: row 0 has the lowest y, as in
  /// nav_msgs/OccupancyGrid.
  Image<Occupancy> cells;
  [[nodiscard]] bool ok() const { return status == GridStatus::ok; }
};

namespace detail {
/// Box of the observed voxels of a map, in another frame, as far as they reach into a band of z there. Coarse
/// cells that could add nothing are not looked into.
template <VoxelMap M>
class ObservedBox {
 public:
  ObservedBox(const M& map, const SE3<double>& T_ground_map, double low, double high)
      : map_(map), T_(T_ground_map), low_(low), high_(high) {
    const Eigen::Matrix3d R = T_.rotation_matrix();
    reach_ = R.cwiseAbs().rowwise().sum() / 2;  // of a rotated cube along the axes, in edges
    for (int k = 0; k < 8; ++k) {
      constexpr int kHalf = 1 << 15;
      descend({{static_cast<std::uint16_t>((k & 1) * kHalf), static_cast<std::uint16_t>((k >> 1 & 1) * kHalf),
                static_cast<std::uint16_t>((k >> 2) * kHalf)}},
              kVoxelLevels - 1);
    }
  }
  [[nodiscard]] const Eigen::AlignedBox2d& box() const { return box_; }

 private:
  void descend(const VoxelKey& key, int level) {
    const Eigen::Vector3d centre = T_ * map_.grid().centre(key, level);
    const Eigen::Vector3d reach = reach_ * map_.grid().edge(level);
    if (centre.z() + reach.z() < low_ || centre.z() - reach.z() > high_) return;
    const Eigen::AlignedBox2d cell(centre.head<2>() - reach.head<2>(), centre.head<2>() + reach.head<2>());
    if (box_.contains(cell) || map_.at(key, level).state == Occupancy::unknown) return;
    if (level == 0) {
      box_.extend(cell);
      return;
    }
    const int half = 1 << (level - 1);
    for (int k = 0; k < 8; ++k) {
      VoxelKey part = key;
      for (std::size_t a = 0; a < 3; ++a) part[a] = static_cast<std::uint16_t>(key[a] + (k >> a & 1) * half);
      descend(part, level - 1);
    }
  }

  const M& map_;
  const SE3<double>& T_;
  double low_, high_;
  Eigen::Vector3d reach_;
  Eigen::AlignedBox2d box_;
};
}  // namespace detail

/// A map seen from above. A cell is occupied where an obstacle's voxel reaches into it within the band of
/// heights; free where none does and enough of its column just above the floor was seen free; else unknown.
/// Voxels that are occupied by what is no obstacle (people) say neither.
/// @param T_ground_map  to the frame of the ground: z up, 0 on the floor; see ground_frame()
/// @param is_obstacle   is_obstacle(voxel) -> bool, of occupied voxels
template <VoxelMap M, std::predicate<const typename M::Voxel&> IsObstacle>
[[nodiscard]] OccupancyGridResult occupancy_grid(const M& map, const SE3<double>& T_ground_map,
                                                 const OccupancyGridOptions& options,
                                                 IsObstacle&& is_obstacle) {
  OccupancyGridResult grid;
  const double edge = map.grid().resolution();
  grid.cell = options.cell == 0 ? edge : options.cell;
  if (!(grid.cell >= edge / 4) || !std::isfinite(grid.cell) || !(options.low < options.high) ||
      !std::isfinite(options.low) || !std::isfinite(options.high) || !std::isfinite(options.clear))
    return grid;

  const Eigen::AlignedBox2d box = detail::ObservedBox<M>(map, T_ground_map, options.low, options.high).box();
  grid.status = GridStatus::nothing_in_band;
  if (box.isEmpty()) return grid;
  // Cells of a fixed raster, so that grids of one frame lie on each other; what rounding alone adds is no
  // cell.
  constexpr double kRounding = 1e-6;
  const Eigen::Vector2d first = ((box.min() / grid.cell).array() + kRounding).floor(),
                        size = ((box.max() / grid.cell).array() - kRounding).ceil() - first.array();
  grid.status = GridStatus::too_many_cells;
  if (!(size.prod() <= static_cast<double>(options.max_cells)) || size.maxCoeff() > 1e9) return grid;
  grid.corner = grid.cell * first;
  grid.cells = Image<Occupancy>(static_cast<int>(size.x()), static_cast<int>(size.y()), Occupancy::unknown);

  // Free: the column of points above a cell's centre. Along a tilted ground voxels and cells do not fall
  // together; a column asked for skips none.
  const SE3<double> T_map_ground = T_ground_map.inverse();
  const double clear = std::clamp(options.clear, 0.0, options.high - options.low);
  const int heights = std::max(1, static_cast<int>(std::ceil(clear / edge)));
  const double needed = std::max(1.0, options.clear_share * heights);
  for (int v = 0; v < grid.cells.height(); ++v) {
    for (int u = 0; u < grid.cells.width(); ++u) {
      const Eigen::Vector2d at = grid.corner + grid.cell * Eigen::Vector2d(u + 0.5, v + 0.5);
      int seen = 0;
      for (int k = 0; k < heights; ++k) {
        const Eigen::Vector3d p(at.x(), at.y(), options.low + (k + 0.5) * clear / heights);
        seen += query_point(map, T_map_ground * p).state == Occupancy::free ? 1 : 0;
      }
      if (seen >= needed) grid.cells(u, v) = Occupancy::free;
    }
  }

  // Occupied: each obstacle's voxel, by points so close together that a wall has no holes whatever its angle.
  const int per_edge = std::max(2, static_cast<int>(std::ceil(2 * edge / grid.cell)));
  const auto mark = [&](const Eigen::Vector3d& p_map) {
    const Eigen::Vector3d p = T_ground_map * p_map;
    if (p.z() < options.low || p.z() > options.high) return;
    const Eigen::Vector2d cell = (p.head<2>() - grid.corner) / grid.cell;
    const int u = static_cast<int>(cell.x()), v = static_cast<int>(cell.y());
    if (cell.minCoeff() >= 0 && grid.cells.contains(u, v)) grid.cells(u, v) = Occupancy::occupied;
  };
  const Eigen::Vector3d everywhere = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
  query_box(map, -everywhere, everywhere, 0, [&](const auto& cell) {
    if (!is_obstacle(cell.voxel)) return;
    for (int x = 0; x < per_edge; ++x)
      for (int y = 0; y < per_edge; ++y)
        for (int z = 0; z < per_edge; ++z) {
          const Eigen::Vector3d offset = (Eigen::Vector3d(x, y, z).array() + 0.5) / per_edge - 0.5;
          mark(cell.centre + edge * offset);
        }
  });
  grid.status = GridStatus::ok;
  return grid;
}

/// The same where every occupied voxel is an obstacle.
template <VoxelMap M>
[[nodiscard]] OccupancyGridResult occupancy_grid(const M& map, const SE3<double>& T_ground_map,
                                                 const OccupancyGridOptions& options = {}) {
  return occupancy_grid(map, T_ground_map, options, [](const typename M::Voxel&) { return true; });
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
