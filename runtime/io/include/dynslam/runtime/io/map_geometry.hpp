// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <filesystem>

#include "dynslam/interop/octomap_semantic_tree.hpp"
#include "dynslam/runtime/io/map_classes.hpp"

namespace dynslam::runtime {

/// Writes the centre of each occupied voxel [m], its colour (voxel_colour()) and its label; the names of the
/// map's classes are comments "label N NAME". Voxels are those of the finest level, whatever is pruned.
///   .ply  binary, little-endian: float x y z, uchar red green blue, uchar label
///   .pcd  of PCL, version 0.7, binary: float x y z, rgb (packed, as PCL has it), uint32 label
/// @throws UsageError for another extension, InputError when the file cannot be written
void save_point_cloud(const interop::SemanticOcTree& tree, const std::filesystem::path& path,
                      const MapClasses& classes = {});

/// Writes the surface between occupied and free space (occupancy_surface()) as a .ply: binary, little-endian;
/// vertices float x y z [m], uchar red green blue, uchar label, of the voxel that they bound; triangles as
/// lists of int. Names of classes as above.
/// @return number of triangles
/// @throws UsageError for another extension, InputError when the file cannot be written
std::size_t save_mesh(const interop::SemanticOcTree& tree, const std::filesystem::path& path,
                      const MapClasses& classes = {});

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
