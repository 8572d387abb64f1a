// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>

#include "dynslam/concepts/map.hpp"
#include "dynslam/semantic/map_voxel.hpp"
#include "dynslam/semantic/ray_traversal.hpp"
#include "dynslam/semantic/voxel_key.hpp"

// Questions of a planner, for any VoxelStore. Points and lengths in metres, in the map's frame; `level` n
// asks about cells of 2^n voxels along each edge.

namespace dynslam {

/// A cell that answers a question.
struct MapCell {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double edge = 0;
  MapVoxel voxel;
  double distance = 0;  ///< from where was asked to the nearest point of the cell
};

/// State of the cell that holds a point; unknown outside the grid.
template <VoxelStore M>
[[nodiscard]] MapVoxel query_point(const M& map, const Eigen::Vector3d& p, int level = 0) {
  const auto key = map.grid().key(p);
  return key ? map.at(*key, level) : MapVoxel{};
}

/// Distance from a point to a cell, 0 inside.
[[nodiscard]] inline double distance_to_cell(const Eigen::Vector3d& p, const Eigen::Vector3d& centre,
                                             double edge) {
  return ((p - centre).cwiseAbs().array() - edge / 2).cwiseMax(0.0).matrix().norm();
}

/// Calls f(MapCell) for each occupied cell that touches the box [low, high].
template <VoxelStore M, class F>
void query_box(const M& map, const Eigen::Vector3d& low, const Eigen::Vector3d& high, int level, F&& f) {
  const VoxelGrid& grid = map.grid();
  const double limit = 32767.5 * grid.resolution();
  const auto bound = [&](const Eigen::Vector3d& p) {
    return grid.key(p.cwiseMax(-limit).cwiseMin(limit).eval());
  };
  const auto a = bound(low), b = bound(high);
  if (!a || !b) return;  // NaN
  map.for_each_occupied(*a, *b, level, [&](const VoxelKey& key, const MapVoxel& voxel) {
    f(MapCell{grid.centre(key, level), grid.edge(level), voxel, 0.0});
  });
}

/// What a ray meets first.
struct RayHit {
  MapCell cell;
  double distance = 0;   ///< along the ray to where it enters the cell
  bool unknown = false;  ///< the cell is unknown, not occupied
};

/// First occupied cell on the ray from `origin` along `direction` (any length but 0), up to `max_range`. With
/// `stop_at_unknown` an unobserved cell ends it, too: to a careful planner that is an obstacle.
/// @return nullopt: the way is free (or begins outside the grid, where nothing is)
template <VoxelStore M>
[[nodiscard]] std::optional<RayHit> cast_ray(const M& map, const Eigen::Vector3d& origin,
                                             const Eigen::Vector3d& direction, double max_range,
                                             bool stop_at_unknown = false, int level = 0) {
  const double length = direction.norm();
  if (!(length > 0) || !std::isfinite(length)) return std::nullopt;
  const Eigen::Vector3d ray = direction / length;
  // Not beyond the grid, where nothing can be.
  const double limit = 32767.0 * map.grid().resolution() - map.grid().edge(level);
  double reach = max_range;
  for (Eigen::Index i = 0; i < 3; ++i) {
    if (!(std::abs(origin(i)) < limit)) return std::nullopt;
    if (ray(i) != 0) reach = std::min(reach, (std::copysign(limit, ray(i)) - origin(i)) / ray(i));
  }
  if (!(reach > 0)) return std::nullopt;
  const Eigen::Vector3d end = origin + ray * reach;
  // Coarse cells are voxels of a coarser grid with the same origin.
  const VoxelGrid coarse(map.grid().edge(level));
  const auto fine = [&](PackedKey packed) {
    VoxelKey key = unpack(packed);
    for (std::size_t i = 0; i < 3; ++i)
      key[i] = static_cast<std::uint16_t>(std::clamp(((int(key[i]) - 32768) << level) + 32768, 0, 65535));
    return key;
  };
  std::optional<RayHit> hit;
  const auto look = [&](PackedKey packed) {
    const VoxelKey key = fine(packed);
    const MapVoxel voxel = map.at(key, level);
    const bool unknown = voxel.state == Occupancy::unknown;
    if (voxel.state != Occupancy::occupied && !(unknown && stop_at_unknown)) return true;
    RayHit found;
    found.cell = {map.grid().centre(key, level), map.grid().edge(level), voxel, 0.0};
    double enter = 0;
    for (Eigen::Index i = 0; i < 3; ++i) {
      if (ray(i) == 0) continue;
      const double face = found.cell.centre(i) - std::copysign(found.cell.edge / 2, ray(i));
      enter = std::max(enter, (face - origin(i)) / ray(i));
    }
    found.distance = enter;
    found.cell.distance = distance_to_cell(origin, found.cell.centre, found.cell.edge);
    found.unknown = unknown;
    hit = found;
    return false;
  };
  if (!traverse_ray<double>(coarse, origin, end, look)) return std::nullopt;
  if (!hit) look(pack(*coarse.key(end)));  // the traversal leaves the last cell out
  return hit;
}

/// Nearest occupied cell within `radius` of a point; ties go to the lower key, so the answer is the same in
/// every run. @return nullopt: none
template <VoxelStore M>
[[nodiscard]] std::optional<MapCell> nearest_obstacle(const M& map, const Eigen::Vector3d& p, double radius,
                                                      int level = 0) {
  std::optional<MapCell> best;
  const auto before = [](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end());
  };
  // Small boxes first: most questions are answered by a few cells.
  for (double r = std::min(radius, 4 * map.grid().edge(level));; r = std::min(radius, 2 * r)) {
    const Eigen::Vector3d d = Eigen::Vector3d::Constant(r);
    query_box(map, p - d, p + d, level, [&](MapCell cell) {
      cell.distance = distance_to_cell(p, cell.centre, cell.edge);
      if (cell.distance > radius) return;
      if (!best || cell.distance < best->distance ||
          (cell.distance == best->distance && before(cell.centre, best->centre)))
        best = cell;
    });
    if ((best && best->distance <= r) || !(r < radius)) return best;
  }
}

}  // namespace dynslam
