// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstdint>
#include <filesystem>
#include <vector>

#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/slam/semantic_mapper.hpp"
#include "dynslam/runtime/slam/types.hpp"

namespace dynslam::runtime {

/// Scans that were saved before, for a map that is saved by a run which builds no octree.
struct SavedScans {
  std::filesystem::path folder;  ///< empty: none
  std::uint64_t map_id = 0;      ///< of the keyframes that were loaded from there
};

/// Refuses a folder that save_slam_map() could not write or must not replace. @throws InputError
void check_map_folder(const std::filesystem::path& folder);

/// Saves what a later session needs to find itself in this map and to go on with it: keyframes.bin
/// (keyframes and points), scans.bin (what the octree was made of) and map.sot. Everything is written beside
/// the folder and then takes its place at once, so that whenever the program or the machine stops, the folder
/// holds the earlier map or the new one; see docs/reliability.md. Other files in the folder stay.
/// @param mapper     finished; null: keyframes and points alone
/// @param otherwise  without a mapper: the scans and the octree to take over
/// @param names      of the mapper's keyframes in this map, where it is not the one that they were made with
/// @throws InputError
void save_slam_map(const LocalMap& map, const CameraConfig& camera, const SemanticMapper* mapper,
                   const std::filesystem::path& folder, const SavedScans& otherwise = {},
                   const std::vector<int>& names = {});

/// @param map_id  receives what tells this saved state from every other one, its check sum
/// @throws InputError naming the file: missing, truncated, corrupt, of another version or of another camera
[[nodiscard]] LocalMap load_slam_map(const std::filesystem::path& folder, const CameraConfig& camera,
                                     std::uint64_t* map_id = nullptr);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
