// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "dynslam/interop/octomap_semantic_tree.hpp"
#include "dynslam/runtime/io/map_classes.hpp"

namespace dynslam::runtime {

/// Red, green, blue.
using Rgb = std::array<std::uint8_t, 3>;

/// Colour of a class in pictures and exports.
[[nodiscard]] Rgb class_colour(std::uint8_t label);
/// "background", "person", "chair", "display", or "label N": without the names of a map's own classes.
[[nodiscard]] std::string class_name(std::uint8_t label);
/// Colour of a voxel in pictures and exports: of its class where it has one, else the one that was seen
/// (never exactly a class's colour, so the class can be told from the colour).
[[nodiscard]] Rgb voxel_colour(const interop::SemanticOcTreeNode& node);

/// Name of the map in the folder of a run and in that of a saved map. It is an OctoMap file, but of a type
/// that OctoMap's own programs do not know: `.ot` is for those that octovis and octomap_server open.
inline constexpr const char* kMapFile = "map.sot";
/// What dynslam 0.1.0 called it.
inline constexpr const char* kEarlierMapFile = "map.ot";
/// The map in a folder: kMapFile, or kEarlierMapFile where there is only that.
[[nodiscard]] std::filesystem::path map_file_in(const std::filesystem::path& folder);

/// Writes a map as an OctoMap file of type SemanticOcTree, `.sot`: everything, exactly. Goes through a
/// temporary file. Own names of classes go into the header, as comments "# label N NAME", and a check sum of
/// everything behind the tree. @throws InputError
void save_map(const interop::SemanticOcTree& tree, const std::filesystem::path& path,
              const MapClasses& classes = {});
/// Reads what save_map() wrote, whatever its name, and files of dynslam 0.1.0, which have no check sum.
/// @param note  takes a line that says so; null: nobody is told
/// @throws InputError naming the file: missing, of another type, cut short or corrupt
[[nodiscard]] std::unique_ptr<interop::SemanticOcTree> load_map(const std::filesystem::path& path,
                                                                std::string* note = nullptr);

/// Names of the classes of a saved map; those of every map where the file has no others or cannot be read.
/// @throws InputError naming a file that is not what its check sum says
[[nodiscard]] MapClasses load_map_classes(const std::filesystem::path& path);

/// Whether a file is a map as save_map() writes it, by its first lines; false where it cannot be read.
[[nodiscard]] bool is_semantic_map(const std::filesystem::path& path);

/// Whether any voxel of a map is occupied.
[[nodiscard]] bool has_occupied(const interop::SemanticOcTree& tree);

/// Exports a map; the file's extension chooses the format. All of them go through a temporary file.
///   .sot  the map itself, as save_map() writes it.
///   .ot   OctoMap's ColorOcTree: log-odds and tree exactly, colours of voxel_colour(); opens in octovis and
///         octomap_server. Votes are left out.
///   .bt   OctoMap's OcTree, one bit: occupied or free; no log-odds, labels or colours.
///   .ply  one vertex per occupied cell: centre [m], colour, label, confidence, edge [m]; no free space.
///   .txt  the summary of to_text(). .json: of to_json().
/// @throws UsageError for another extension, InputError when the file cannot be written
void export_map(const interop::SemanticOcTree& tree, const std::filesystem::path& path,
                const MapClasses& classes = {});

/// What a map holds. Voxels are counted at full resolution, whatever is pruned.
struct MapSummary {
  double resolution = 0;             ///< metres
  std::size_t nodes = 0, bytes = 0;  ///< of the tree in memory
  std::size_t occupied = 0, free = 0;
  std::array<std::size_t, kMapLabels> occupied_of_label{};
  std::array<double, kMapLabels> confidence_of_label{};  ///< mean over the label's voxels
  MapClasses classes{};                                  ///< names of the labels
  std::array<double, 3> low{}, high{};  ///< box of what is occupied [m]; equal where nothing is

  [[nodiscard]] double volume(std::size_t voxels) const {  ///< m^3
    return static_cast<double>(voxels) * resolution * resolution * resolution;
  }
};
/// Counts the leaves of a map.
[[nodiscard]] MapSummary summarize(const interop::SemanticOcTree& tree, const MapClasses& classes = {});
/// As `map info` prints it.
[[nodiscard]] std::string to_text(const MapSummary& summary);
/// As `map info --json` prints it.
[[nodiscard]] nlohmann::json to_json(const MapSummary& summary);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
