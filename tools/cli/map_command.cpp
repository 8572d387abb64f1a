// SPDX-License-Identifier: BSD-3-Clause
#include "map_command.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <filesystem>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/evaluation/map_render.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "dynslam/semantic/map_query.hpp"
#include "map_export.hpp"
#include "validators.hpp"

namespace dynslam::app {

namespace {

namespace rt = dynslam::runtime;

const char* name(Occupancy state) {
  switch (state) {
    case Occupancy::free:
      return "free";
    case Occupancy::occupied:
      return "occupied";
    case Occupancy::unknown:
      break;
  }
  return "unknown";
}

nlohmann::json to_json(const MapVoxel& voxel, const rt::MapClasses& classes) {
  nlohmann::json j{{"state", name(voxel.state)}};
  if (voxel.state == Occupancy::unknown) return j;
  j["probability"] = log_odds_to_probability(static_cast<double>(voxel.log_odds));
  if (voxel.state == Occupancy::occupied) {
    j["class"] = classes.name(voxel.label);
    j["confidence"] = voxel.confidence;
  }
  return j;
}

nlohmann::json to_json(const MapCell& cell, const rt::MapClasses& classes) {
  nlohmann::json j = to_json(cell.voxel, classes);
  j["centre_m"] = {cell.centre.x(), cell.centre.y(), cell.centre.z()};
  j["edge_m"] = cell.edge;
  return j;
}

std::string to_text(const nlohmann::json& j) {
  std::string text = j["state"].get<std::string>();
  if (j.contains("class"))
    text += fmt::format(" {} ({:.0f} %)", j["class"].get<std::string>(), 100 * j["confidence"].get<double>());
  if (j.contains("probability")) text += fmt::format(", probability {:.3f}", j["probability"].get<double>());
  if (j.contains("centre_m"))
    text += fmt::format(", cell at {:.3f} {:.3f} {:.3f} of {:g} m", j["centre_m"][0].get<double>(),
                        j["centre_m"][1].get<double>(), j["centre_m"][2].get<double>(),
                        j["edge_m"].get<double>());
  if (j.contains("distance_m")) text += fmt::format(", distance {:.3f} m", j["distance_m"].get<double>());
  return text + '\n';
}

Eigen::Vector3d point(const std::vector<double>& v, std::size_t first = 0) {
  return {v[first], v[first + 1], v[first + 2]};
}

}  // namespace

struct MapCommand::Options {
  CLI::App* command = nullptr;
  CLI::App* info = nullptr;
  CLI::App* exporter = nullptr;
  CLI::App* query = nullptr;
  CLI::App* render = nullptr;
  std::unique_ptr<MapExport> files;
  std::filesystem::path file, out;
  bool json = false;
  std::vector<double> at, box, ray, nearest;
  double range = 5.0, cell = 0.0;
  bool unknown_blocks = false;
  std::string colours = "classes";

  [[nodiscard]] int run_query() const;
};

MapCommand::MapCommand(CLI::App& app) : o_(std::make_unique<Options>()) {
  Options& o = *o_;
  o.command = app.add_subcommand("map", "Look into a saved map (map.sot), export it, ask it");
  o.command->require_subcommand(1);
  const auto add = [&](const char* command, const char* what) {
    CLI::App* sub = o.command->add_subcommand(command, what);
    sub->add_option("file", o.file, "Map of `dynslam run`: map.sot (map.ot of dynslam 0.1.0)")->required();
    return sub;
  };
  o.info = add("info", "Voxels and volume per class");
  o.info->add_flag("--json", o.json, "Print JSON");

  o.exporter = add("export", "Write it for other programs");
  o.files = std::make_unique<MapExport>(*o.exporter);

  o.query =
      add("query", "Ask as a planner would; lengths in metres, in the map's frame (the first camera's)");
  const auto numbers = [&](const char* option, std::vector<double>& to, int n, const char* what) {
    return o.query->add_option(option, to, what)->expected(n)->check(finite());
  };
  auto* at = numbers("--at", o.at, 3, "X Y Z: what is there");
  auto* box = numbers("--box", o.box, 6, "X Y Z X Y Z: what is occupied between two corners");
  auto* ray = numbers("--ray", o.ray, 6, "X Y Z DX DY DZ: what a ray from a point meets first");
  auto* nearest = numbers("--nearest", o.nearest, 3, "X Y Z: the nearest obstacle");
  const std::vector<CLI::Option*> questions{at, box, ray, nearest};
  for (CLI::Option* a : questions) {
    for (CLI::Option* b : questions) {
      if (a != b) a->excludes(b);
    }
  }
  o.query->add_option("--range", o.range, "Length of the ray, radius around the point [m]")
      ->capture_default_str()
      ->check(finite());
  o.query->add_option("--cell", o.cell, "Ask about cells of about this size [m] (default: voxels)")
      ->check(number_in(0, 1e6));
  o.query->add_flag("--unknown-blocks", o.unknown_blocks, "Unknown space ends a ray, too");
  o.query->add_flag("--json", o.json, "Print JSON");

  o.render = add("render", "Picture of the map from behind and above the first camera");
  o.render->add_option("out", o.out, "PNG file to make")->required();
  o.render->add_option("--colours", o.colours, "classes or height")
      ->capture_default_str()
      ->check(CLI::IsMember({"classes", "height"}));
}

MapCommand::~MapCommand() = default;

bool MapCommand::chosen() const {
  return o_->command->parsed();
}

int MapCommand::run() const {
  const Options& o = *o_;
  if (*o.info) {
    const rt::MapSummary summary = rt::summarize(*load_checked_map(o.file), rt::load_map_classes(o.file));
    std::cout << (o.json ? rt::to_json(summary).dump() + "\n" : rt::to_text(summary));
    return 0;
  }
  if (*o.exporter) {
    o.files->run(o.file);
    return 0;
  }
  if (*o.render) {
    check_other_file(o.file, o.out);
    const auto tree = load_checked_map(o.file);
    const rt::MapView view = rt::fit_view(*tree, rt::view_behind(SE3<double>()));
    rt::write_image(o.out,
                    rt::render_map(*tree, view,
                                   o.colours == "height" ? rt::MapColours::height : rt::MapColours::classes));
    warn_if_empty(*tree, o.file, {o.out});
    return 0;
  }
  return o.run_query();
}

int MapCommand::Options::run_query() const {
  if (at.empty() && box.empty() && ray.empty() && nearest.empty())
    throw rt::UsageError("map query needs a question: --at, --box, --ray or --nearest");
  if (!(range > 0)) throw rt::UsageError("--range must be above 0");
  const auto tree = load_checked_map(file);
  const rt::MapClasses names = rt::load_map_classes(file);
  const double edge = tree->getResolution();
  const int level =
      cell > edge ? std::min(kVoxelLevels - 1, static_cast<int>(std::lround(std::log2(cell / edge)))) : 0;

  nlohmann::json answer;
  if (!at.empty()) {
    answer = to_json(query_point(*tree, point(at), level), names);
  } else if (!ray.empty()) {
    const Eigen::Vector3d direction = point(ray, 3);
    if (!(direction.norm() > 0)) throw rt::UsageError("--ray: the direction is zero");
    const auto hit = cast_ray(*tree, point(ray), direction,
                              {.max_range = range, .stop_at_unknown = unknown_blocks, .level = level});
    if (!hit.ok()) throw rt::UsageError("--ray: does not begin in the map's grid");
    if (hit.blocked()) {
      answer = to_json(hit.cell, names);
      answer["distance_m"] = hit.distance;
    } else {
      answer = {{"state", "free"}, {"distance_m", range}};
    }
  } else if (!nearest.empty()) {
    const auto found = nearest_obstacle(*tree, point(nearest), range, level);
    if (!found.ok()) throw rt::UsageError("--nearest: is no point");
    if (found.found()) {
      answer = to_json(found.cell, names);
      answer["distance_m"] = found.cell.distance;
    } else {
      answer = {{"state", "none"}, {"distance_m", range}};
    }
  } else {
    const Eigen::Vector3d a = point(box), b = point(box, 3);
    std::map<std::string, std::size_t> cells;
    std::size_t total = 0;
    query_box(*tree, a.cwiseMin(b), a.cwiseMax(b), level, [&](const auto& c) {
      ++cells[names.name(c.voxel.label)];
      ++total;
    });
    answer = {{"occupied_cells", total}, {"edge_m", tree->grid().edge(level)}, {"classes", cells}};
    if (!json) {
      std::cout << fmt::format("{} occupied cells of {:g} m\n", total, tree->grid().edge(level));
      for (const auto& [label, count] : cells) std::cout << fmt::format("{:<12} {:>9}\n", label, count);
      return 0;
    }
  }
  std::cout << (json ? answer.dump() + "\n" : to_text(answer));
  return 0;
}

}  // namespace dynslam::app
