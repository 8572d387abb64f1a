// SPDX-License-Identifier: BSD-3-Clause
#include "map_export.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iostream>
#include <numbers>
#include <set>
#include <string>
#include <system_error>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/map_geometry.hpp"
#include "dynslam/runtime/io/map_grid.hpp"
#include "dynslam/runtime/io/read_file.hpp"
#include "validators.hpp"
#include "warnings.hpp"

namespace dynslam::app {

namespace {

namespace rt = dynslam::runtime;

/// What a grid lies on, and how much of it is known: what was found is to be looked at before a robot drives
/// by it.
std::string describe_grid(const rt::MapGrid& map, bool found) {
  const Image<Occupancy>& cells = map.grid.cells;
  const auto count = static_cast<std::ptrdiff_t>(cells.width()) * cells.height();
  const auto share = [&](Occupancy state) {
    return 100.0 * static_cast<double>(std::count(cells.data(), cells.data() + count, state)) /
           static_cast<double>(count);
  };
  std::string text;
  if (found) {
    const double tilt = std::acos(std::clamp(-map.ground.up.y(), -1.0, 1.0)) * 180 / std::numbers::pi;
    text = fmt::format("floor {:.2f} m below the first camera, which is tilted by {:.1f} degrees; ",
                       map.ground.origin_height, tilt);
  }
  return text + fmt::format("{} x {} cells of {:g} m: {:.1f} % free, {:.1f} % occupied, the rest unknown\n",
                            cells.width(), cells.height(), map.grid.cell, share(Occupancy::free),
                            share(Occupancy::occupied));
}

}  // namespace

std::unique_ptr<interop::SemanticOcTree> load_checked_map(const std::filesystem::path& map) {
  std::string note;
  auto tree = rt::load_map(map, &note);
  if (!note.empty()) warn({note});
  return tree;
}

void warn_if_empty(const interop::SemanticOcTree& tree, const std::filesystem::path& map,
                   const std::vector<std::filesystem::path>& made) {
  if (made.empty() || rt::has_occupied(tree)) return;
  std::string files;
  for (const std::filesystem::path& file : made) files += (files.empty() ? "" : ", ") + file.string();
  warn({fmt::format("{}: has no occupied voxel, so there is nothing to see in {}", map.string(), files)});
}

void check_other_file(const std::filesystem::path& map, const std::filesystem::path& out) {
  std::error_code error;
  if (!out.empty() && std::filesystem::equivalent(map, out, error))
    throw rt::UsageError(
        fmt::format("{} is the map itself, which would be lost: name another file to make", out.string()));
}

namespace {

/// Before anything is written: nothing is lost, neither the map nor one output to another.
void check_outputs(const std::filesystem::path& map, const std::vector<std::filesystem::path>& files) {
  std::set<std::filesystem::path> places;
  for (const std::filesystem::path& file : files) {
    check_other_file(map, file);
    rt::check_regular_file(file);
    std::error_code error;  // of a path that cannot be written
    const auto place = std::filesystem::weakly_canonical(std::filesystem::absolute(file), error);
    if (!error && !places.insert(place).second)
      throw rt::UsageError(fmt::format(
          "{} is named for two outputs, one of which would be lost: name another file", file.string()));
  }
}

}  // namespace

struct MapExport::Options {
  std::filesystem::path out, grid_file, cloud, mesh;
  rt::MapGridOptions grid;
  std::vector<double> band, up;
  double camera_height = 0;
  CLI::Option* camera_height_given = nullptr;
};

MapExport::MapExport(CLI::App& command) : o_(std::make_unique<Options>()) {
  Options& o = *o_;
  command.add_option(
      "out", o.out,
      "File to make: .ot (ColorOcTree for octovis), .bt (OcTree), .ply (coloured points), .txt "
      "or .json (summary), .sot (the map itself)");
  command.add_option("--pointcloud", o.cloud,
                     "Point cloud to make, .ply or .pcd (PCL): centres of occupied voxels, colours, labels");
  command.add_option("--mesh", o.mesh, "Mesh to make, .ply: the surface between occupied and free space");
  auto* grid =
      command.add_option("--grid", o.grid_file,
                         "Occupancy grid to make, .pgm, with its .yaml beside it, for map_server and Nav2");
  const auto of_grid = [&](CLI::Option* option) { return option->needs(grid); };
  of_grid(command.add_option(
              "--band", o.band,
              "LOW HIGH: heights above the floor in which voxels are obstacles [m] (default: 0.1 1.8)"))
      ->expected(2)
      ->check(finite());
  of_grid(command.add_option("--cell", o.grid.grid.cell, "Edge of a cell [m] (default: that of a voxel)"))
      ->check(number_in(0.001, 100));
  o.camera_height_given = of_grid(command.add_option(
      "--camera-height", o.camera_height,
      "Height of the first camera above the floor [m] (default: the floor is looked for in the map)"));
  o.camera_height_given->check(finite());
  of_grid(command.add_option(
              "--up", o.up,
              "X Y Z: the direction that is up, in the map's frame (x right, y down, z ahead); about, "
              "where the floor is looked for (default: 0 -1 0)"))
      ->expected(3)
      ->check(finite());
  of_grid(command.add_option("--only", o.grid.only, "Classes that are obstacles (default: all but people)"))
      ->delimiter(',')
      ->allow_extra_args(false);
  of_grid(command.add_option("--ignore", o.grid.ignored, "Classes that are none, beside people"))
      ->delimiter(',')
      ->allow_extra_args(false);
}

MapExport::~MapExport() = default;

void MapExport::run(const std::filesystem::path& map) const {
  const Options& o = *o_;
  if (o.out.empty() && o.grid_file.empty() && o.cloud.empty() && o.mesh.empty())
    throw rt::UsageError("map export needs a file to make: OUT, --grid, --pointcloud or --mesh");
  std::vector<std::filesystem::path> made;  // by the map's voxels
  for (const std::filesystem::path& file : {o.out, o.cloud, o.mesh})
    if (!file.empty()) made.push_back(file);
  std::vector<std::filesystem::path> files = made;
  if (!o.grid_file.empty()) files.insert(files.end(), {o.grid_file, rt::yaml_of_grid(o.grid_file)});
  check_outputs(map, files);
  const auto tree = load_checked_map(map);
  const rt::MapClasses classes = rt::load_map_classes(map);
  if (!o.out.empty()) rt::export_map(*tree, o.out, classes);
  if (!o.cloud.empty()) rt::save_point_cloud(*tree, o.cloud, classes);
  if (!o.mesh.empty()) {
    const std::size_t triangles = rt::save_mesh(*tree, o.mesh, classes);
    std::cout << fmt::format("{} triangles between occupied and free space\n", triangles);
  }
  warn_if_empty(*tree, map, made);
  if (o.grid_file.empty()) return;
  rt::MapGridOptions options = o.grid;
  if (!o.band.empty()) {
    options.grid.low = o.band[0];
    options.grid.high = o.band[1];
  }
  if (!o.up.empty()) options.up = {o.up[0], o.up[1], o.up[2]};
  if (!o.camera_height_given->empty()) options.camera_height = o.camera_height;
  const rt::MapGrid grid = rt::make_map_grid(*tree, options, classes, map);
  rt::save_map_grid(grid, o.grid_file);
  std::cout << describe_grid(grid, !options.camera_height);
}

}  // namespace dynslam::app
