// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include "dynslam/runtime/io/map_io.hpp"
#include "io/base64.hpp"
#include "report/payload.hpp"

namespace dynslam::runtime::reporting {
namespace {

using interop::SemanticOcTree;

struct Voxel {
  std::array<std::int64_t, 3> corner;  // lowest, in voxels of the finest size
  int level = 0;                       // 2^level of those per edge
  std::uint8_t label = 0;
  Rgb colour{};
};

std::vector<Voxel> occupied(const SemanticOcTree& tree, int depth) {
  std::vector<Voxel> voxels;
  const double edge = tree.getResolution();
  for (auto it = tree.begin_leafs(static_cast<unsigned char>(depth)), end = tree.end_leafs(); it != end;
       ++it) {
    if (!tree.isNodeOccupied(*it)) continue;
    const double size = it.getSize();
    const auto corner = [&](double centre) { return std::llround((centre - size / 2) / edge); };
    voxels.push_back({{corner(it.getX()), corner(it.getY()), corner(it.getZ())},
                      static_cast<int>(std::lround(std::log2(size / edge))),
                      it->label(),
                      voxel_colour(*it)});
  }
  return voxels;
}

}  // namespace

json map_payload(const RunFolder& run, std::size_t most, std::vector<std::string>& thinned) {
  if (!run.has_map()) return nullptr;
  const auto tree = load_map(map_file_in(run.folder));
  const MapClasses names = load_map_classes(map_file_in(run.folder));
  int depth = static_cast<int>(tree->getTreeDepth());
  std::vector<Voxel> voxels = occupied(*tree, depth);
  const std::size_t all = voxels.size();
  while (voxels.size() > most && depth > 8) voxels = occupied(*tree, --depth);
  const double edge = tree->getResolution();
  if (voxels.size() < all) {
    const double drawn = edge * std::pow(2.0, static_cast<int>(tree->getTreeDepth()) - depth);
    thinned.push_back(fmt::format("{}: {} voxels of {:.3g} m are drawn as {} of {:.3g} m", run.name, all,
                                  edge, voxels.size(), drawn));
  }
  std::array<std::int64_t, 3> low{};
  low.fill(std::numeric_limits<std::int64_t>::max());
  for (const Voxel& v : voxels) {
    for (std::size_t k = 0; k < 3; ++k) low[k] = std::min(low[k], v.corner[k]);
  }
  if (voxels.empty()) low.fill(0);
  std::vector<std::uint8_t> bytes;
  std::array<std::size_t, kMapLabels> count{};
  for (const Voxel& v : voxels) {
    for (std::size_t k = 0; k < 3; ++k) {  // within an octree of 16 levels the differences have 16 bits
      const auto at = static_cast<std::uint32_t>(v.corner[k] - low[k]);
      bytes.push_back(static_cast<std::uint8_t>(at & 255U));
      bytes.push_back(static_cast<std::uint8_t>(at >> 8U & 255U));
    }
    bytes.push_back(static_cast<std::uint8_t>(v.level));
    bytes.push_back(v.label);
    bytes.insert(bytes.end(), v.colour.begin(), v.colour.end());
    if (v.label < count.size()) ++count[v.label];
  }
  json classes = json::array();
  for (std::size_t label = 0; label < count.size(); ++label) {
    if (count[label] == 0) continue;
    const auto name = static_cast<std::uint8_t>(label);
    classes.push_back({{"label", label},
                       {"name", names.name(name)},
                       {"colour", class_colour(name)},
                       {"count", count[label]}});
  }
  json corner = json::array();
  for (const std::int64_t k : low) corner.push_back(number(static_cast<double>(k) * edge, 6));
  return {{"edge", edge}, {"low", corner},      {"count", voxels.size()},
          {"of", all},    {"classes", classes}, {"voxels", to_base64(bytes)}};
}

}  // namespace dynslam::runtime::reporting
