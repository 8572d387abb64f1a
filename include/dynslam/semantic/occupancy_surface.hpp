// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <utility>
#include <vector>

#include "dynslam/concepts/map.hpp"
#include "dynslam/semantic/log_odds.hpp"
#include "dynslam/semantic/marching_cubes.hpp"
#include "dynslam/semantic/voxel_key.hpp"

namespace dynslam {

/// Triangles between what is occupied and what is free.
struct OccupancySurface {
  std::vector<Eigen::Vector3d> vertices;                ///< [m], in the map's frame
  std::vector<VoxelKey> voxels;                         ///< of each vertex: the occupied voxel that it bounds
  std::vector<std::array<std::uint32_t, 3>> triangles;  ///< vertices, counter-clockwise seen from free space
};

namespace detail {
/// Log-odds of a voxel, or their sign where the map keeps none.
template <class Voxel>
[[nodiscard]] double log_odds_of(const Voxel& voxel) {
  if constexpr (requires {
                  { voxel.log_odds } -> std::convertible_to<double>;
                }) {
    return static_cast<double>(voxel.log_odds);
  } else {
    return voxel.state == Occupancy::occupied ? 1.0 : -1.0;
  }
}

/// Builds an OccupancySurface cube by cube; a cube has its corners at the centres of 2 x 2 x 2 voxels.
template <VoxelMap M>
class SurfaceBuilder {
 public:
  explicit SurfaceBuilder(const M& map) : map_(map), grid_(map.grid()) {}

  /// The cubes around an occupied voxel, those of which it is the first occupied corner.
  void add_around(const VoxelKey& key, const typename M::Voxel& voxel) {
    std::array<typename M::Voxel, 27> around;  // x fastest
    for (int i = 0; i < 27; ++i) {
      const std::array<int, 3> at{key[0] + i % 3 - 1, key[1] + i / 3 % 3 - 1, key[2] + i / 9 - 1};
      if (*std::min_element(at.begin(), at.end()) < 0 || *std::max_element(at.begin(), at.end()) > 65535)
        continue;
      around[static_cast<std::size_t>(i)] =
          i == 13 ? voxel
                  : map_.at({{static_cast<std::uint16_t>(at[0]), static_cast<std::uint16_t>(at[1]),
                              static_cast<std::uint16_t>(at[2])}},
                            0);
    }
    for (int c = 0; c < 8; ++c) {
      const auto bit = [&](int axis) { return c >> axis & 1; };
      Cube cube;
      bool inside = true;
      for (int a = 0; a < 3; ++a) {
        const int low = key[static_cast<std::size_t>(a)] - bit(a);
        inside = inside && low >= 0 && low < 65535;
        cube.low[static_cast<std::size_t>(a)] = static_cast<std::uint16_t>(low);
      }
      if (!inside) continue;
      int first = -1;
      for (int k = 0; k < 8 && (first < 0 || first == c); ++k) {
        const int i = (1 - bit(0) + (k & 1)) + 3 * (1 - bit(1) + (k >> 1 & 1)) + 9 * (1 - bit(2) + (k >> 2));
        cube.corners[static_cast<std::size_t>(k)] = &around[static_cast<std::size_t>(i)];
        if (first < 0 && around[static_cast<std::size_t>(i)].state == Occupancy::occupied) first = k;
      }
      if (first == c) add(cube);
    }
  }
  [[nodiscard]] OccupancySurface take() { return std::move(surface_); }

 private:
  struct Cube {
    VoxelKey low;
    std::array<const typename M::Voxel*, 8> corners{};
  };

  void add(const Cube& cube) {
    std::size_t inside = 0;  // what is unknown may be behind a surface, and has none of its own
    for (std::size_t k = 0; k < 8; ++k)
      inside |= cube.corners[k]->state == Occupancy::free ? 0U : std::size_t(1) << k;
    for (const CubeTriangle& triangle : marching_cubes_case(inside)) {
      const bool known = std::all_of(triangle.begin(), triangle.end(), [&](std::uint8_t edge) {
        const auto [a, b] = cube_edge(edge);
        return cube.corners[(inside >> a & 1) != 0 ? a : b]->state == Occupancy::occupied;
      });
      if (!known) continue;
      std::array<std::uint32_t, 3> vertices;
      for (std::size_t i = 0; i < 3; ++i) vertices[i] = vertex(cube, inside, triangle[i]);
      surface_.triangles.push_back(vertices);
    }
  }

  std::uint32_t vertex(const Cube& cube, std::size_t inside, std::uint8_t edge) {
    const auto [a, b] = cube_edge(edge);
    const std::size_t in = (inside >> a & 1) != 0 ? a : b, out = in == a ? b : a;
    const VoxelKey low = corner_key(cube, a);
    const std::uint64_t id = std::uint64_t(low[0]) | std::uint64_t(low[1]) << 16 |
                             std::uint64_t(low[2]) << 32 | std::uint64_t(edge / 4U) << 48;
    const auto [at, is_new] = index_.emplace(id, static_cast<std::uint32_t>(surface_.vertices.size()));
    if (is_new) {
      const double l_in = log_odds_of(*cube.corners[in]), l_out = log_odds_of(*cube.corners[out]);
      // Not at a centre itself, where the vertices of several edges would be one.
      constexpr double kMargin = 0.02;
      const double t = std::clamp(l_out / (l_out - l_in), kMargin, 1 - kMargin);
      const VoxelKey key = corner_key(cube, in);
      const Eigen::Vector3d from = grid_.centre(corner_key(cube, out)), to = grid_.centre(key);
      surface_.vertices.push_back(from + t * (to - from));
      surface_.voxels.push_back(key);
    }
    return at->second;
  }
  [[nodiscard]] static VoxelKey corner_key(const Cube& cube, std::size_t corner) {
    VoxelKey key = cube.low;
    for (std::size_t axis = 0; axis < 3; ++axis)
      key[axis] = static_cast<std::uint16_t>(key[axis] + (corner >> axis & 1));
    return key;
  }

  const M& map_;
  VoxelGrid grid_;
  OccupancySurface surface_;
  std::unordered_map<std::uint64_t, std::uint32_t> index_;  // of vertices, by the edge that they lie on
};
}  // namespace detail

/// The surface at which log-odds are 0 between free and occupied voxels: marching cubes (Lorensen and Cline
/// 1987) over the voxels' centres, vertices by linear interpolation of log-odds. Unobserved space bounds
/// nothing: a surface ends where free space is unknown on one side, and is closed where everything around it
/// was seen.
template <VoxelMap M>
[[nodiscard]] OccupancySurface occupancy_surface(const M& map) {
  detail::SurfaceBuilder<M> builder(map);
  map.for_each_occupied(
      VoxelKey{{0, 0, 0}}, VoxelKey{{65535, 65535, 65535}}, 0,
      [&](const VoxelKey& key, const typename M::Voxel& voxel) { builder.add_around(key, voxel); });
  return builder.take();
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
