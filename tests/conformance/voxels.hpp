// SPDX-License-Identifier: BSD-3-Clause
// One run of every question and every way to fill a map, over one kind of store.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "cameras.hpp"
#include "dynslam/concepts/map.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/semantic/depth_code.hpp"
#include "dynslam/semantic/ground_plane.hpp"
#include "dynslam/semantic/label_histogram.hpp"
#include "dynslam/semantic/map_query.hpp"
#include "dynslam/semantic/map_scan.hpp"
#include "dynslam/semantic/map_voxel.hpp"
#include "dynslam/semantic/marching_cubes.hpp"
#include "dynslam/semantic/occupancy_grid.hpp"
#include "dynslam/semantic/occupancy_surface.hpp"
#include "dynslam/semantic/ray_bits.hpp"
#include "dynslam/semantic/ray_traversal.hpp"
#include "dynslam/semantic/scan_voxels.hpp"
#include "dynslam/semantic/voxel_end.hpp"
#include "dynslam/semantic/voxel_key.hpp"
#include "record.hpp"

namespace dynslam::test {

/// A store of another project: a sorted list that keeps of each voxel what its owner likes.
class ListStore {
 public:
  using Key = VoxelKey;
  using Scan = ScanVoxels;
  struct Voxel {
    Occupancy state = Occupancy::unknown;
    double temperature = 0;
  };

  explicit ListStore(const VoxelGrid& grid) : grid_(grid) {}
  [[nodiscard]] VoxelGrid grid() const { return grid_; }
  void integrate(const Scan& scan) {
    for (const std::uint32_t b : scan.order()) {
      const ScanBlock& block = scan.block(b);
      for (std::size_t i = 0; i < 512; ++i) {
        const bool hit = (block.hit[i >> 6] >> (i & 63) & 1) != 0,
                   miss = (block.miss[i >> 6] >> (i & 63) & 1) != 0;
        if (!hit && !miss) continue;
        VoxelKey key = block.key();
        const VoxelKey offset = Scan::offset_in_block(i);
        for (std::size_t a = 0; a < 3; ++a) key[a] = static_cast<std::uint16_t>(key[a] + offset[a]);
        voxels_[key] = {hit ? Occupancy::occupied : Occupancy::free, 20.0};
      }
    }
  }
  [[nodiscard]] Voxel at(const VoxelKey& key, int level) const {
    Voxel out;
    for (const auto& [k, voxel] : voxels_) {
      if (key_at_level(k, level) == key_at_level(key, level) && out.state != Occupancy::occupied) out = voxel;
    }
    return out;
  }
  template <class F>
  void for_each_occupied(const VoxelKey& low, const VoxelKey& high, int level, F&& f) const {
    std::map<VoxelKey, Voxel> cells;
    for (const auto& [k, voxel] : voxels_) {
      if (voxel.state == Occupancy::occupied) cells.emplace(key_at_level(k, level), voxel);
    }
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
static_assert(VoxelStore<ListStore>);

/// A scan of a slanted wall, by points of the scalar S.
template <std::size_t N, std::floating_point S>
[[nodiscard]] BasicScanVoxels<N> wall_scan() {
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  BasicScanVoxels<N> scan{VoxelGrid(0.1)};
  const Vector3 eye(S(0.05), S(0.05), S(0.05));
  for (int i = -6; i <= 6; ++i) {
    for (int j = -4; j <= 4; ++j) {
      const Vector3 p(S(0.1 * i + 0.03), S(0.1 * j + 0.03), S(1.23 + 0.05 * i));
      scan.add_end(p, static_cast<std::uint8_t>(i < 0 ? 2 : 3), {10, 20, 30});
      scan.carve(eye, p);
      scan.carve_once(eye + S(0) * p, p);
      scan.template carve_all<S>(eye, std::span<const Eigen::Matrix<S, 3, 1>>(&p, 1));
    }
  }
  scan.finish();
  return scan;
}

/// Every question, with points of the scalar S.
template <std::floating_point S, VoxelMap M>
void ask(const M& map, Record<double>& out) {
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  const Vector3 eye(S(0.05), S(0.05), S(0.05)), wall(S(0.03), S(0.03), S(1.23));
  const auto state = [](const auto& voxel) { return static_cast<double>(voxel.state); };
  for (const int level : {0, 1, 3}) {
    const std::string at = "level " + std::to_string(level) + " ";
    out.put(at + "query_point", state(query_point(map, wall, level)));
    out.put(at + "query_point.way", state(query_point(map, S(0.5) * (eye + wall), level)));
    out.put(at + "query_point.far", state(query_point(map, {50, 0, 0}, level)));
    double cells = 0, sum = 0;
    const double far = std::numeric_limits<double>::infinity();
    out.put(
        at + "query_box.ok",
        query_box(map, {-far, -far, -far}, Vector3(S(9), S(9), S(9)), level, [&](const MapCellOf<M>& cell) {
          ++cells;
          sum += cell.centre.dot(Eigen::Vector3d(1, 2, 3)) + cell.edge + state(cell.voxel);
        }));
    out.put(at + "query_box.cells", cells);
    out.put(at + "query_box.sum", sum);
    RayOptions options;
    options.max_range = 5;
    options.level = level;
    for (const bool careful : {false, true}) {
      options.stop_at_unknown = careful;
      for (const Vector3& direction :
           {Vector3(wall - eye), Vector3(S(0), S(0.1), S(-1)), Vector3(S(1), S(0.2), S(1))}) {
        const RayResultOf<M> ray = cast_ray(map, eye, direction, options);
        out.put(at + "cast_ray.status", static_cast<double>(ray.status));
        out.put(at + "cast_ray.distance", ray.distance);
        out.put(at + "cast_ray.unknown", static_cast<double>(ray.unknown_cells));
      }
    }
    const NearestResultOf<M> nearest = nearest_obstacle(map, eye - Vector3(S(0), S(0), S(1)), 10.0, level);
    out.put(at + "nearest_obstacle.found", nearest.found());
    out.put(at + "nearest_obstacle.distance", nearest.cell.distance);
    out.put(at + "nearest_obstacle.centre", nearest.cell.centre);
  }
}

/// The map as planners have it.
template <VoxelMap M>
void plan(const M& map, Record<double>& out) {
  const OccupancyGridResult grid = occupancy_grid(map, *ground_frame({0, -1, 0.1}, 0.3), {.high = 0.7});
  out.put("occupancy_grid.ok", grid.ok());
  out.put("occupancy_grid.corner", grid.corner);
  double sum = 0;
  for (int v = 0; v < grid.cells.height(); ++v)
    for (int u = 0; u < grid.cells.width(); ++u)
      sum += (1 + u + 100 * v) * static_cast<int>(grid.cells(u, v));
  out.put("occupancy_grid.cells", sum);
  GroundPlaneOptions options;  // the wall, as a floor under a camera that looks down
  options.up = -Eigen::Vector3d::UnitZ();
  options.max_points = 20;
  out.put("fit_ground_plane", fit_ground_plane(map, options).has_value());
}

/// The map as triangles, as many in every store. Where there are no log-odds their vertices are elsewhere.
template <VoxelMap M>
void draw(const M& map, Record<double>& out) {
  const OccupancySurface surface = occupancy_surface(map);
  out.put("occupancy_surface.vertices", static_cast<double>(surface.vertices.size()));
  out.put("occupancy_surface.triangles", static_cast<double>(surface.triangles.size()));
  out.put("marching_cubes_case", static_cast<double>(marching_cubes_case(1).size()));
}

/// A store after one scan, asked everything.
template <std::floating_point S, VoxelStore Store>
[[nodiscard]] Record<double> store_results(Store& store) {
  store.integrate(wall_scan<Store::Scan::kLabels, S>());
  Record<double> out;
  ask<S>(store, out);
  plan(store, out);
  draw(store, out);
  return out;
}

/// A keyframe as a scan and as voxels.
template <class Camera, std::floating_point S>
[[nodiscard]] Record<double> scan_results() {
  const auto camera = conformance_camera<Camera>();
  const MapScanner<S> scanner(camera, kWidth, kHeight);
  const Image<S> depth(kWidth, kHeight, S(2.03));
  const Image<std::uint8_t> none;
  const Image<std::array<std::uint8_t, 3>> colours(kWidth, kHeight, {1, 2, 3});
  const auto scan = scanner.template pack<20>(depth, none, none, colours);
  BasicScanVoxels<20> voxels{VoxelGrid(0.1)};
  scanner.gather(scan, SE3<S>(), voxels);
  Record<double> out;
  const auto key = voxels.grid().key(Eigen::Vector3d(0.05, 0.05, 2.05));
  out.put("wall", key && voxels.is_end(*key));
  out.put("wall.beyond", voxels.is_end(*voxels.grid().key(Eigen::Vector3d(0.05, 0.05, 2.15))));
  out.put("consistent", scan.consistent());
  return out;
}

}  // namespace dynslam::test
