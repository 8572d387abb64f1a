// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <limits>
#include <optional>

#include "dynslam/concepts/map.hpp"
#include "dynslam/concepts/scalar.hpp"
#include "dynslam/semantic/log_odds.hpp"
#include "dynslam/semantic/map_voxel.hpp"
#include "dynslam/semantic/ray_traversal.hpp"
#include "dynslam/semantic/voxel_key.hpp"

// Questions of a planner, for any VoxelMap. Points and lengths in metres, in the map's frame; points of float
// or double, answers in double. `level` n, 0 to 15, asks about cells of 2^n voxels along each edge. An answer
// from NaN, or from outside the grid, says so: it is never "free".
//
// Cells have their faces: what touches a box, or lies exactly at a radius or range, counts, as far as
// rounding goes (kQueryRounding). Of the cells that share a face a point on it is in the upper one alone, and
// a ray within it passes the upper one.

namespace dynslam {

/// A cell that answers a question.
template <class Voxel>
struct BasicMapCell {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double edge = 0;
  Voxel voxel{};
  double distance = 0;  ///< from where was asked to the nearest point of the cell
};
using MapCell = BasicMapCell<MapVoxel>;  ///< of this library's own maps
/// The cells of a map of type M.
template <VoxelMap M>
using MapCellOf = BasicMapCell<typename M::Voxel>;

/// A point or direction of a question: any Eigen vector of 3 floats or doubles, or {x, y, z}.
struct QueryVector : Eigen::Vector3d {
  QueryVector(double x, double y, double z) : Eigen::Vector3d(x, y, z) {}
  template <class D>
    requires(FixedMatrix<D, 3>&& std::floating_point<typename D::Scalar>)
  QueryVector(const Eigen::MatrixBase<D>& p)  // NOLINT(google-explicit-constructor): it is a parameter
      : Eigen::Vector3d(p.template cast<double>()) {}
};

/// By how much more than asked for a query looks, as a share of the coordinates and lengths that it is asked
/// with: 0.3 m is not 3 voxels of 0.1 m in binary numbers. It covers some thousand roundings of a double.
inline constexpr double kQueryRounding = 1e-12;

namespace detail {
/// Outermost point of the grid along an axis that is safely inside, in voxels.
inline constexpr double kGridReach = 32767.5;

/// kQueryRounding in metres at a point. @param reach  how far from there is asked about
[[nodiscard]] inline double query_rounding(const VoxelGrid& grid, const Eigen::Vector3d& p,
                                           double reach = 0) {
  return kQueryRounding * (p.cwiseAbs().maxCoeff() + reach + grid.resolution());
}
/// Key of a point that was moved into the grid, and there by `slack` along each axis.
[[nodiscard]] inline std::optional<VoxelKey> key_within(const VoxelGrid& grid, const Eigen::Vector3d& p,
                                                        double slack) {
  const double limit = kGridReach * grid.resolution();
  return grid.key((p.cwiseMax(-limit).cwiseMin(limit).array() + slack).matrix().eval());
}
}  // namespace detail

namespace detail {
/// Asks a map for the states of many cells, as cheaply as it can: by its `Reader`, where it has one.
template <VoxelMap M>
class StateReader {
 public:
  explicit StateReader(const M& map) : map_(&map) {}
  [[nodiscard]] Occupancy state(const VoxelKey& key, int level) const { return map_->at(key, level).state; }

 private:
  const M* map_;
};
template <VoxelMap M>
  requires requires(typename M::Reader& reader, const VoxelKey& key, int level) {
    { reader.state(key, level) } -> std::same_as<Occupancy>;
  }
class StateReader<M> : public M::Reader {
 public:
  using M::Reader::Reader;
};
}  // namespace detail

/// State of the cell that holds a point; unknown outside the grid.
template <VoxelMap M>
[[nodiscard]] typename M::Voxel query_point(const M& map, const QueryVector& p, int level = 0) {
  const auto key = map.grid().key(p);
  return key && level >= 0 && level < kVoxelLevels ? map.at(*key, level) : typename M::Voxel{};
}

/// Distance from a point to a cell, 0 inside.
[[nodiscard]] inline double distance_to_cell(const QueryVector& p, const Eigen::Vector3d& centre,
                                             double edge) {
  return ((p - centre).cwiseAbs().array() - edge / 2).cwiseMax(0.0).matrix().norm();
}

/// Calls f(cell) for each occupied cell that touches the box [low, high], be it with a face; f takes a
/// MapCellOf<M>.
/// @return false for a bound that is NaN, or a level that is none: f is not called then
template <VoxelMap M, class F>
bool query_box(const M& map, const QueryVector& low, const QueryVector& high, int level, F&& f) {
  const VoxelGrid& grid = map.grid();
  if (low.hasNaN() || high.hasNaN() || level < 0 || level >= kVoxelLevels) return false;
  const double border = grid.edge(kVoxelLevels - 1);
  if (low.maxCoeff() > border || high.minCoeff() < -border) return true;  // beside the grid
  const auto slack = [&](const Eigen::Vector3d& p) {
    return detail::query_rounding(grid, p.cwiseMax(-border).cwiseMin(border));
  };
  const auto a = detail::key_within(grid, low, -slack(low)), b = detail::key_within(grid, high, slack(high));
  if (!a || !b) return false;
  map.for_each_occupied(*a, *b, level, [&](const VoxelKey& key, const typename M::Voxel& voxel) {
    f(MapCellOf<M>{grid.centre(key, level), grid.edge(level), voxel, 0.0});
  });
  return true;
}

/// What a ray came upon.
enum class RayStatus : std::uint8_t {
  free,          ///< nothing occupied up to max_range or the border of the grid
  hit,           ///< an occupied cell
  unknown,       ///< an unobserved cell, or the border of the grid; only with stop_at_unknown
  outside_grid,  ///< the origin lies outside the grid, where the map knows nothing
  bad_input      ///< NaN, no direction, a range that is not above 0, or a level that is none
};

/// Options of cast_ray.
struct RayOptions {
  double max_range = 0;  ///< [m] above 0, may be infinite
  bool stop_at_unknown =
      false;      ///< an unobserved cell ends the ray: to a careful planner that is an obstacle
  int level = 0;  ///< of the cells, 0 to 15
};

/// What a ray meets first.
template <class Voxel>
struct BasicRayResult {
  RayStatus status = RayStatus::bad_input;
  BasicMapCell<Voxel> cell;  ///< with hit and unknown; without an edge where that is the border of the grid
  double distance = 0;  ///< along the ray: to where it enters the cell, or as far as the way was followed
  std::size_t unknown_cells = 0;  ///< passed on the way; a free way of unknown cells is not known to be free
  /// Whether the map could answer.
  [[nodiscard]] bool ok() const {
    return status != RayStatus::bad_input && status != RayStatus::outside_grid;
  }
  /// Whether something ends the way.
  [[nodiscard]] bool blocked() const { return status == RayStatus::hit || status == RayStatus::unknown; }
};
/// Answers of this library's own maps.
using RayResult = BasicRayResult<MapVoxel>;
/// Answers of a map of type M.
template <VoxelMap M>
using RayResultOf = BasicRayResult<typename M::Voxel>;

namespace detail {
/// Key of a cell from that of the coarser grid with the same origin, in which it is a voxel.
[[nodiscard]] inline VoxelKey fine_key(PackedKey coarse, int level) {
  VoxelKey key = unpack(coarse);
  for (std::size_t i = 0; i < 3; ++i)
    key[i] = static_cast<std::uint16_t>(std::clamp((int(key[i]) - 32768) * (1 << level) + 32768, 0, 65535));
  return key;
}
/// State of a cell by its key in the grid of its level. @param cells  a StateReader
template <class Cells>
[[nodiscard]] Occupancy state_of(Cells& cells, PackedKey coarse, int level) {
  if constexpr (requires { cells.state(coarse); }) {
    if (level == 0) return cells.state(coarse);
  }
  return cells.state(fine_key(coarse, level), level);
}
}  // namespace detail

/// First occupied cell on the ray from `origin` along `direction` (any length but 0), be it exactly at the
/// end of the range.
template <VoxelMap M>
[[nodiscard]] RayResultOf<M> cast_ray(const M& map, const QueryVector& origin, const QueryVector& direction,
                                      const RayOptions& options) {
  RayResultOf<M> result;
  const double length = direction.norm();
  const int level = options.level;
  if (!(length > 0) || !std::isfinite(length) || origin.hasNaN() || !(options.max_range > 0) || level < 0 ||
      level >= kVoxelLevels)
    return result;
  const Eigen::Vector3d ray = direction / length;
  const VoxelGrid& grid = map.grid();
  const double limit = detail::kGridReach * grid.resolution();
  double reach = options.max_range;
  bool to_border = false;
  result.status = RayStatus::outside_grid;
  for (Eigen::Index i = 0; i < 3; ++i) {
    if (!(std::abs(origin(i)) < limit)) return result;
    if (ray(i) == 0) continue;
    const double border = (std::copysign(limit, ray(i)) - origin(i)) / ray(i);
    to_border = to_border || border < reach;
    reach = std::min(reach, border);
  }
  const double slack = detail::query_rounding(grid, origin, reach);
  const Eigen::Vector3d end = (origin + ray * (reach + slack)).cwiseMax(-limit).cwiseMin(limit);
  const auto enter = [&](const Eigen::Vector3d& centre, double edge) {
    double t = 0;
    for (Eigen::Index i = 0; i < 3; ++i) {
      if (ray(i) == 0) continue;
      t = std::max(t, (centre(i) - std::copysign(edge / 2, ray(i)) - origin(i)) / ray(i));
    }
    return t;
  };
  result.status = RayStatus::free;
  result.distance = reach;
  detail::StateReader<M> cells(map);
  PackedKey at = 0;
  const auto may_pass = [&](PackedKey packed) {
    const Occupancy state = detail::state_of(cells, packed, level);
    result.unknown_cells += state == Occupancy::unknown ? 1U : 0U;
    const bool stops =
        state == Occupancy::occupied || (state == Occupancy::unknown && options.stop_at_unknown);
    if (!stops) [[likely]]
      return true;
    result.status = state == Occupancy::occupied ? RayStatus::hit : RayStatus::unknown;
    at = packed;
    return false;
  };
  const VoxelGrid coarse(grid.edge(level));
  traverse_ray(coarse, origin, end, may_pass);
  // The traversal leaves the last cell out.
  if (result.status == RayStatus::free) (void)may_pass(pack(*coarse.key(end)));
  if (result.blocked()) {
    const VoxelKey key = detail::fine_key(at, level);
    result.cell = {grid.centre(key, level), grid.edge(level), map.at(key, level), 0.0};
    result.cell.distance = distance_to_cell(origin, result.cell.centre, result.cell.edge);
    result.distance = std::min(reach, enter(result.cell.centre, result.cell.edge));
  }
  if (result.status == RayStatus::free && to_border && options.stop_at_unknown) {
    result.status = RayStatus::unknown;
    result.cell.centre = end;
  }
  return result;
}

/// Whether something occupied is near.
enum class NearestStatus : std::uint8_t {
  none,      ///< no occupied cell within the radius
  found,     ///< `cell`
  bad_input  ///< NaN, an infinite point, a radius below 0, or a level that is none
};

/// The occupied cell that is nearest to a point.
template <class Voxel>
struct BasicNearestResult {
  NearestStatus status = NearestStatus::bad_input;
  BasicMapCell<Voxel> cell;
  [[nodiscard]] bool ok() const { return status != NearestStatus::bad_input; }
  [[nodiscard]] bool found() const { return status == NearestStatus::found; }
};
/// Answers of this library's own maps.
using NearestResult = BasicNearestResult<MapVoxel>;
/// Answers of a map of type M.
template <VoxelMap M>
using NearestResultOf = BasicNearestResult<typename M::Voxel>;

namespace detail {
/// Branch and bound from coarse cells to fine ones, nearer ones first. A coarse cell that is not occupied has
/// nothing in it; one farther away than the best found so far has nothing nearer.
template <VoxelMap M>
class NearestSearch {
 public:
  NearestSearch(const M& map, const Eigen::Vector3d& p, double radius, int level)
      : map_(map), states_(map), p_(p), level_(level) {
    set_bound(radius);
  }

  void run() {
    // The cells of one level that the ball can touch: two along an axis, where the level's edge is its
    // diameter.
    const VoxelGrid& grid = map_.grid();
    int top = level_;
    while (top < kVoxelLevels && grid.edge(top) < 2 * bound_) ++top;
    const auto low = key_within(grid, (p_.array() - limit_).matrix(), 0.0),
               high = key_within(grid, (p_.array() + limit_).matrix(), 0.0);
    if (!low || !high) return;
    const VoxelKey a = key_at_level(*low, top), b = key_at_level(*high, top);
    Candidates<27> cells;  // 3 x 3 x 3 at most
    for (int z = a[2]; z <= int(b[2]); z += 1 << top) {
      for (int y = a[1]; y <= int(b[1]); y += 1 << top) {
        for (int x = a[0]; x <= int(b[0]); x += 1 << top)
          add(cells, {x, y, z}, gap(0, x, top) + gap(1, y, top) + gap(2, z, top));
      }
    }
    descend(cells, top);
  }
  [[nodiscard]] NearestResultOf<M> result() const {
    return {found_ ? NearestStatus::found : NearestStatus::none, best_};
  }

 private:
  /// Cells of one level by their distance.
  template <std::size_t capacity>
  struct Candidates {
    struct Cell {
      VoxelKey key;
      double square;  // of the distance [m^2]
    };
    std::array<Cell, capacity> cells;
    std::size_t count = 0;
  };
  template <std::size_t capacity>
  void add(Candidates<capacity>& to, const std::array<int, 3>& key, double square) const {
    if (too_far(square) || to.count == capacity) return;
    std::size_t i = to.count++;
    for (; i > 0 && to.cells[i - 1].square > square; --i) to.cells[i] = to.cells[i - 1];
    to.cells[i] = {{{static_cast<std::uint16_t>(key[0]), static_cast<std::uint16_t>(key[1]),
                     static_cast<std::uint16_t>(key[2])}},
                   square};
  }
  /// Squared distance along one axis to a cell that begins at `key`.
  [[nodiscard]] double gap(Eigen::Index axis, int key, int level) const {
    const double half = map_.grid().edge(level) / 2,
                 centre = static_cast<double>(key - 32768) * map_.grid().resolution() + half;
    const double d = std::max(0.0, std::abs(p_(axis) - centre) - half);
    return d * d;
  }
  /// With room for rounding: a coarse cell's distance is that of its parts only nearly.
  [[nodiscard]] bool too_far(double square) const { return square > limit_ * limit_; }
  void set_bound(double bound) {
    bound_ = bound;
    limit_ = bound + query_rounding(map_.grid(), p_, bound);
  }

  template <std::size_t capacity>
  void descend(const Candidates<capacity>& cells, int level) {
    for (std::size_t i = 0; i < cells.count && !too_far(cells.cells[i].square); ++i) {
      const VoxelKey& key = cells.cells[i].key;
      if (states_.state(key, level) != Occupancy::occupied) continue;
      if (level == level_) {
        take(key);
        continue;
      }
      const int half = 1 << (level - 1);
      std::array<std::array<double, 2>, 3> gaps;
      for (std::size_t a = 0; a < 3; ++a)
        gaps[a] = {gap(Eigen::Index(a), key[a], level - 1), gap(Eigen::Index(a), key[a] + half, level - 1)};
      Candidates<8> parts;
      for (unsigned k = 0; k < 8; ++k) {
        const unsigned x = k & 1U, y = k >> 1U & 1U, z = k >> 2U;
        add(parts, {key[0] + int(x) * half, key[1] + int(y) * half, key[2] + int(z) * half},
            gaps[0][x] + gaps[1][y] + gaps[2][z]);
      }
      descend(parts, level - 1);
    }
  }
  void take(const VoxelKey& key) {
    const VoxelGrid& grid = map_.grid();
    const Eigen::Vector3d centre = grid.centre(key, level_);
    const double edge = grid.edge(level_), distance = distance_to_cell(p_, centre, edge);
    if (distance > (found_ ? bound_ : limit_)) return;
    if (found_ && distance == bound_ &&
        !std::lexicographical_compare(centre.begin(), centre.end(), best_.centre.begin(), best_.centre.end()))
      return;
    found_ = true;
    set_bound(distance);
    best_ = {centre, edge, map_.at(key, level_), distance};
  }

  const M& map_;
  StateReader<M> states_;
  Eigen::Vector3d p_;
  int level_;
  double bound_ = 0;  // distance of the best cell so far, the radius before the first
  double limit_ = 0;  // the same with room for rounding
  bool found_ = false;
  MapCellOf<M> best_;
};
}  // namespace detail

/// Nearest occupied cell within `radius` of a point, be it exactly so far away, by descent through coarse
/// cells, nearer ones first. Ties go to the lower key, so the answer is the same in every run.
template <VoxelMap M>
[[nodiscard]] NearestResultOf<M> nearest_obstacle(const M& map, const QueryVector& p, double radius,
                                                  int level = 0) {
  if (!p.allFinite() || !(radius >= 0) || level < 0 || level >= kVoxelLevels) return {};
  detail::NearestSearch<M> search(map, p, radius, level);
  search.run();
  return search.result();
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
