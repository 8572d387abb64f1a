// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "dynslam/runtime/io/sequence.hpp"

namespace dynslam::runtime {

/// What a map still holds of dynamic objects.
struct MapLeftovers {
  std::size_t frames = 0;  ///< with a pose and a true mask
  std::size_t voxels = 0;  ///< occupied, in which only dynamic pixels were ever seen
  double edge = 0;         ///< of a voxel [m]
};

/// Counts the occupied voxels of a run's map in which the sequence's true masks (`dynamic_mask/`) have
/// dynamic pixels, placed by the run's own final poses, and in which no frame has a static one: feet stand on
/// voxels that are the floor's.
/// @param run       folder of a run, with a map
/// @param sequence  folder of the sequence
/// @throws InputError  no map, no trajectory, no masks or none of a frame with a pose, unreadable images
[[nodiscard]] MapLeftovers map_leftovers(const std::filesystem::path& run,
                                         const std::filesystem::path& sequence,
                                         const SequenceOptions& options = {});
/// {"frames": n, "voxels": n, "edge_m": m}
[[nodiscard]] nlohmann::json to_json(const MapLeftovers& leftovers);
/// As `eval --map` prints it.
[[nodiscard]] std::string to_text(const MapLeftovers& leftovers);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
