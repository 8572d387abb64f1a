// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "dynslam/interop/octomap_semantic_tree.hpp"
#include "dynslam/runtime/io/map_classes.hpp"
#include "dynslam/semantic/ground_plane.hpp"
#include "dynslam/semantic/occupancy_grid.hpp"

namespace dynslam::runtime {

/// Options of make_map_grid.
struct MapGridOptions {
  OccupancyGridOptions grid{};
  Eigen::Vector3d up =
      -Eigen::Vector3d::UnitY();          ///< in the map's frame; about, where the floor is looked for
  std::optional<double> camera_height{};  ///< of the first camera above the floor [m], with `up` exact;
                                          ///< empty: the floor is looked for in the map
  std::vector<std::string> only{};        ///< classes that are obstacles; empty: all but people
  std::vector<std::string> ignored{};     ///< classes that are none, beside people
};

/// A map seen from above, and on what ground.
struct MapGrid {
  GroundPlane ground;
  SE3<double> T_ground_map;
  OccupancyGridResult grid;
};

/// The occupancy grid of a map. People are never obstacles.
/// @throws UsageError for options that fit neither each other nor the map's classes; InputError naming `map`
/// where it has no floor, nothing in the band, or would have too many cells
[[nodiscard]] MapGrid make_map_grid(const interop::SemanticOcTree& tree, const MapGridOptions& options,
                                    const MapClasses& classes, const std::filesystem::path& map);

/// The .yaml beside a grid's .pgm. @throws UsageError for another extension
[[nodiscard]] std::filesystem::path yaml_of_grid(std::filesystem::path pgm);

/// Writes a grid as ROS' map_server and Nav2 read it: a PGM (occupied 0, free 254, unknown 205; the first row
/// has the highest y) and beside it, under the same name, a .yaml of mode trinary. The frame is that of the
/// ground (ground_frame()), T_ground_map a comment. The .yaml comes last.
/// @throws UsageError for another extension than .pgm, InputError when a file cannot be written
void save_map_grid(const MapGrid& grid, const std::filesystem::path& pgm);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
