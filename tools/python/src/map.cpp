// SPDX-License-Identifier: BSD-3-Clause
#include "map.hpp"

#include <fmt/format.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "bindings.hpp"
#include "dynslam/runtime/io/map_geometry.hpp"
#include "dynslam/runtime/io/map_grid.hpp"
#include "dynslam/runtime/io/map_io.hpp"
#include "dynslam/semantic/map_query.hpp"

namespace dynslam::python {

namespace {

/// A cell that answers a question.
struct Cell {
  MapCell cell;
  std::string label;

  Cell(const MapCell& c, const runtime::MapClasses& classes) : cell(c), label(classes.name(c.voxel.label)) {}
};

const char* name(Occupancy state) {
  return state == Occupancy::free ? "free" : state == Occupancy::occupied ? "occupied" : "unknown";
}

int checked_level(int level) {
  if (level < 0 || level >= kVoxelLevels)
    throw py::value_error(fmt::format("level: expected 0 to {}, got {}", kVoxelLevels - 1, level));
  return level;
}

Map load(const std::filesystem::path& path) {
  const py::gil_scoped_release released;
  const auto file = std::filesystem::is_directory(path) ? runtime::map_file_in(path) : path;
  return {runtime::load_map(file), runtime::load_map_classes(file)};
}

Cell query_point(const Map& map, const py::object& p, int level) {
  const Eigen::Vector3d at = point(p, "p");
  MapCell cell;
  cell.voxel = dynslam::query_point(*map.tree, at, checked_level(level));
  cell.edge = map.tree->grid().edge(level);
  if (const auto key = map.tree->grid().key(at)) cell.centre = map.tree->grid().centre(*key, level);
  return {cell, map.classes};
}

std::optional<Cell> cast_ray(const Map& map, const py::object& origin, const py::object& direction,
                             double max_range, bool stop_at_unknown, int level) {
  const auto hit = dynslam::cast_ray(
      *map.tree, point(origin, "origin"), point(direction, "direction"),
      {.max_range = max_range, .stop_at_unknown = stop_at_unknown, .level = checked_level(level)});
  if (hit.status == RayStatus::outside_grid) throw py::value_error("origin: outside of the map's grid");
  if (!hit.ok())
    throw py::value_error("direction, max_range: expected a direction that is not 0 and a range above 0");
  if (!hit.blocked()) return std::nullopt;
  Cell cell(hit.cell, map.classes);
  cell.cell.distance = hit.distance;
  return cell;
}

std::optional<Cell> nearest_obstacle(const Map& map, const py::object& p, double radius, int level) {
  const auto found = dynslam::nearest_obstacle(*map.tree, point(p, "p"), radius, checked_level(level));
  if (!found.ok()) throw py::value_error("radius: expected a number from 0");
  if (!found.found()) return std::nullopt;
  return Cell(found.cell, map.classes);
}

/// Centres [m], labels and colours of the occupied cells between two corners.
py::tuple cells_between(const Map& map, const Eigen::Vector3d& a, const Eigen::Vector3d& b, int level) {
  std::vector<double> centres;
  std::vector<std::uint8_t> labels;
  {
    const py::gil_scoped_release released;
    query_box(*map.tree, a.cwiseMin(b), a.cwiseMax(b), level, [&](const auto& cell) {
      centres.insert(centres.end(), cell.centre.data(), cell.centre.data() + 3);
      labels.push_back(cell.voxel.label);
    });
  }
  const auto count = static_cast<py::ssize_t>(labels.size());
  return py::make_tuple(py::array_t<double>({count, py::ssize_t(3)}, centres.data()),
                        py::array_t<std::uint8_t>(count, labels.data()));
}

void save_grid(const Map& map, const std::filesystem::path& pgm, std::pair<double, double> band, double cell,
               const std::optional<double>& camera_height, const py::object& up,
               std::vector<std::string> only, std::vector<std::string> ignore) {
  runtime::MapGridOptions options;
  options.grid.low = band.first;
  options.grid.high = band.second;
  options.grid.cell = cell;
  options.camera_height = camera_height;
  if (!up.is_none()) options.up = point(up, "up");
  options.only = std::move(only);
  options.ignored = std::move(ignore);
  const py::gil_scoped_release released;
  runtime::save_map_grid(runtime::make_map_grid(*map.tree, options, map.classes, "the map"), pgm);
}

void bind_cell(py::module_& m) {
  py::class_<Cell>(m, "MapCell", "A cell of the map that answers a question.")
      .def_property_readonly(
          "state", [](const Cell& c) { return name(c.cell.voxel.state); }, "'free', 'occupied' or 'unknown'.")
      .def_property_readonly(
          "probability",
          [](const Cell& c) { return log_odds_to_probability(static_cast<double>(c.cell.voxel.log_odds)); },
          "Of being occupied.")
      .def_property_readonly(
          "label", [](const Cell& c) { return c.label; }, "Name of its class, where it is occupied.")
      .def_property_readonly(
          "confidence", [](const Cell& c) { return c.cell.voxel.confidence; },
          "Share of votes for the class.")
      .def_property_readonly(
          "centre", [](const Cell& c) { return py::array_t<double>(3, c.cell.centre.data()); },
          "(3,) float64 [m].")
      .def_property_readonly(
          "edge", [](const Cell& c) { return c.cell.edge; }, "[m]")
      .def_property_readonly(
          "distance", [](const Cell& c) { return c.cell.distance; }, "From where was asked [m].")
      .def("__repr__", [](const Cell& c) {
        return fmt::format("<dynslam.MapCell {} {} at {:.3f} {:.3f} {:.3f}, {:g} m>",
                           name(c.cell.voxel.state), c.label, c.cell.centre.x(), c.cell.centre.y(),
                           c.cell.centre.z(), c.cell.edge);
      });
}

}  // namespace

void bind_map(py::module_& m) {
  bind_cell(m);
  py::class_<Map>(m, "Map",
                  "A semantic map of voxels. Points and lengths in metres, in the map's frame: the first "
                  "camera's (x right, "
                  "y down, z ahead).")
      .def_static("load", &load, py::arg("path"), "Of a file map.sot, or the folder of a run or a saved map.")
      .def_property_readonly(
          "resolution", [](const Map& map) { return map.tree->getResolution(); }, "Edge of a voxel [m].")
      .def("query_point", &query_point, py::arg("p"), py::arg("level") = 0,
           "The cell that holds a point (3,); cells have 2**level voxels along each edge.")
      .def("cast_ray", &cast_ray, py::arg("origin"), py::arg("direction"), py::arg("max_range") = 5.0,
           py::arg("stop_at_unknown") = false, py::arg("level") = 0,
           "The first occupied cell on a ray; None: the way is free.")
      .def("nearest_obstacle", &nearest_obstacle, py::arg("p"), py::arg("radius"), py::arg("level") = 0,
           "The nearest occupied cell within a radius; None: there is none.")
      .def(
          "query_box",
          [](const Map& map, const py::object& low, const py::object& high, int level) {
            return cells_between(map, point(low, "low"), point(high, "high"), checked_level(level));
          },
          py::arg("low"), py::arg("high"), py::arg("level") = 0,
          "Occupied cells between two corners: centres (N, 3) float64, labels (N,) uint8.")
      .def(
          "voxels",
          [](const Map& map) {
            const Eigen::Vector3d far = Eigen::Vector3d::Constant(1e9);
            return cells_between(map, -far, far, 0);
          },
          "All occupied voxels: centres (N, 3) float64, labels (N,) uint8.")
      .def(
          "class_name",
          [](const Map& map, int label) {
            if (label < 0 || label >= static_cast<int>(kMapLabels))
              throw py::value_error("label: the map has none of that number");
            return map.classes.name(static_cast<std::uint8_t>(label));
          },
          py::arg("label"))
      .def(
          "summary",
          [](const Map& map) {
            return py::module_::import("json").attr("loads")(
                to_json(runtime::summarize(*map.tree, map.classes)).dump());
          },
          "Voxels and volume per class, as `dynslam map info --json` prints it.")
      .def(
          "export",
          [](const Map& map, const std::filesystem::path& file) {
            const py::gil_scoped_release released;
            runtime::export_map(*map.tree, file, map.classes);
          },
          py::arg("file"), ".sot, .ot (octovis), .bt, .ply, .txt or .json, as `dynslam map export`.")
      .def(
          "save_point_cloud",
          [](const Map& map, const std::filesystem::path& file) {
            const py::gil_scoped_release released;
            runtime::save_point_cloud(*map.tree, file, map.classes);
          },
          py::arg("file"), "Centres, colours and labels of occupied voxels: .ply or .pcd.")
      .def(
          "save_mesh",
          [](const Map& map, const std::filesystem::path& file) {
            const py::gil_scoped_release released;
            return runtime::save_mesh(*map.tree, file, map.classes);
          },
          py::arg("file"),
          "The surface between occupied and free space: .ply. Returns the number of triangles.")
      .def("save_grid", &save_grid, py::arg("pgm"), py::kw_only(), py::arg("band") = std::make_pair(0.1, 1.8),
           py::arg("cell") = 0.0, py::arg("camera_height") = py::none(), py::arg("up") = py::none(),
           py::arg("only") = std::vector<std::string>(), py::arg("ignore") = std::vector<std::string>(),
           "Occupancy grid for ROS' map_server and Nav2: a .pgm and its .yaml. band: heights of obstacles "
           "above the floor [m]; "
           "camera_height: of the first camera above it [m] (None: the floor is looked for).");
}

}  // namespace dynslam::python
