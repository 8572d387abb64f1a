// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/io/map_grid.hpp"

#include <fmt/format.h>

#include <array>
#include <cstdint>
#include <string>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/atomic_file.hpp"
#include "dynslam/runtime/masks.hpp"

namespace dynslam::runtime {
namespace {

/// Whether a label's voxels are obstacles.
std::array<bool, kMapLabels> obstacle_labels(const MapGridOptions& options, const MapClasses& classes) {
  const auto label = [&](const std::string& name) {
    const auto found = classes.find(name);
    if (!found) throw UsageError(fmt::format("the map has no class '{}'", name));
    return *found;
  };
  std::array<bool, kMapLabels> obstacle{};
  obstacle.fill(options.only.empty());
  for (const std::string& name : options.only) obstacle[label(name)] = true;
  for (const std::string& name : options.ignored) obstacle[label(name)] = false;
  obstacle[static_cast<std::size_t>(Label::person)] = false;
  return obstacle;
}

GroundPlane find_ground(const interop::SemanticOcTree& tree, const MapGridOptions& options,
                        const std::filesystem::path& map) {
  if (!(options.up.norm() > 0)) throw UsageError("up has no direction");
  if (options.camera_height) return {options.up.normalized(), *options.camera_height, 0};
  GroundPlaneOptions search;
  search.up = options.up;
  const auto found = fit_ground_plane(tree, search);
  if (!found) {
    throw InputError(
        map.string(), 0,
        "shows no floor: give the first camera's height above it (--camera-height) and, if it is "
        "not upright, the direction that is up (--up)");
  }
  return *found;
}

/// Values by which map_server's trinary mode tells the states: (255 - value) / 255 is above occupied_thresh,
/// below free_thresh, or between. Of 205 that is 0.19608.
constexpr std::uint8_t kOccupied = 0, kFree = 254, kUnknown = 205;
constexpr const char* kThresholds = "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";

/// A scalar of YAML in double quotes.
std::string yaml_string(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + '"';
}

std::string pgm_of(const OccupancyGridResult& grid) {
  const Image<Occupancy>& cells = grid.cells;
  std::string pgm = fmt::format("P5\n{} {}\n255\n", cells.width(), cells.height());
  for (int v = cells.height() - 1; v >= 0; --v) {
    for (int u = 0; u < cells.width(); ++u) {
      const Occupancy state = cells(u, v);
      pgm += static_cast<char>(state == Occupancy::occupied ? kOccupied
                               : state == Occupancy::free   ? kFree
                                                            : kUnknown);
    }
  }
  return pgm;
}

}  // namespace

MapGrid make_map_grid(const interop::SemanticOcTree& tree, const MapGridOptions& options,
                      const MapClasses& classes, const std::filesystem::path& map) {
  const auto obstacle = obstacle_labels(options, classes);
  MapGrid out;
  out.ground = find_ground(tree, options, map);
  const auto frame = ground_frame(out.ground.up, out.ground.origin_height);
  if (!frame) throw UsageError("the ground has no finite height");
  out.T_ground_map = *frame;
  out.grid = occupancy_grid(tree, out.T_ground_map, options.grid,
                            [&](const MapVoxel& voxel) { return obstacle[voxel.label]; });
  switch (out.grid.status) {
    case GridStatus::ok:
      break;
    case GridStatus::nothing_in_band:
      throw InputError(map.string(), 0,
                       fmt::format("shows nothing between {:g} and {:g} m above the floor", options.grid.low,
                                   options.grid.high));
    case GridStatus::too_many_cells:
      throw InputError(map.string(), 0,
                       fmt::format("is too large for a grid of {:g} m cells (more than {} of them)",
                                   out.grid.cell, options.grid.max_cells));
    case GridStatus::bad_input:
      throw UsageError("a grid needs cells of some size, and a band from a lower to a higher height");
  }
  return out;
}

std::filesystem::path yaml_of_grid(std::filesystem::path pgm) {
  if (pgm.extension() != ".pgm")
    throw UsageError(fmt::format("'{}': a grid's extension is .pgm", pgm.string()));
  return pgm.replace_extension(".yaml");
}

void save_map_grid(const MapGrid& map, const std::filesystem::path& pgm) {
  const std::filesystem::path yaml_file = yaml_of_grid(pgm);
  const Eigen::Matrix4d T = map.T_ground_map.matrix();
  std::string yaml = "# x, y, z in this grid's frame (z up, 0 on the floor) of a point in the map's:\n";
  for (Eigen::Index i = 0; i < 3; ++i)
    yaml += fmt::format("#   {:9.6f} {:9.6f} {:9.6f} {:9.6f}\n", T(i, 0), T(i, 1), T(i, 2), T(i, 3));
  yaml += fmt::format("image: {}\nmode: trinary\nresolution: {:.10g}\norigin: [{:.10g}, {:.10g}, 0]\n",
                      yaml_string(pgm.filename().string()), map.grid.cell, map.grid.corner.x(),
                      map.grid.corner.y());
  write_file(pgm, pgm_of(map.grid));
  write_file(yaml_file, yaml + kThresholds);
}

}  // namespace dynslam::runtime
