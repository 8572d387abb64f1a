// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>

#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/slam/semantic_mapper.hpp"
#include "dynslam/runtime/slam/types.hpp"

namespace dynslam::runtime {

/// Refuses a folder that save_slam_map() could not write or must not replace. @throws InputError
void check_map_folder(const std::filesystem::path& folder);

/// Saves what a later session needs to find itself in this map and to go on with it: keyframes.bin
/// (keyframes and points), scans.bin (what the octree was made of) and map.ot. Everything is written beside
/// the folder and then takes its place, so an earlier map stays whole until the new one is.
/// @param mapper  finished; null: keyframes and points alone
/// @throws InputError
void save_slam_map(const LocalMap& map, const CameraConfig& camera, const SemanticMapper* mapper,
                   const std::filesystem::path& folder);

/// @throws InputError naming the file: missing, truncated, corrupt, of another version or of another camera
[[nodiscard]] LocalMap load_slam_map(const std::filesystem::path& folder, const CameraConfig& camera);

}  // namespace dynslam::runtime
