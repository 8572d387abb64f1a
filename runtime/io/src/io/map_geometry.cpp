// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/io/map_geometry.hpp"

#include <fmt/format.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/atomic_file.hpp"
#include "dynslam/runtime/io/map_io.hpp"
#include "dynslam/runtime/masks.hpp"
#include "dynslam/semantic/occupancy_surface.hpp"
#include "io/binary_file.hpp"

namespace dynslam::runtime {
namespace {

using interop::SemanticOcTree;
using Node = interop::SemanticOcTreeNode;

void append_point(BinaryWriter& bytes, const Eigen::Vector3d& p) {
  for (Eigen::Index i = 0; i < 3; ++i) bytes.put(static_cast<float>(p(i)));
}

/// "PREFIX N NAME" for each label that the map's classes have.
std::string label_lines(const char* prefix, const MapClasses& classes) {
  std::string lines;
  for (std::uint8_t label = 0; label < kMapLabels; ++label)
    if (label <= static_cast<std::uint8_t>(Label::display) || classes.own(label))
      lines += fmt::format("{} label {} {}\n", prefix, label, classes.name(label));
  return lines;
}

/// Calls f(centre, node) for each occupied voxel of the finest level.
template <class F>
void for_each_occupied_voxel(const SemanticOcTree& tree, F&& f) {
  const double edge = tree.getResolution();
  for (auto it = tree.begin_leafs(), end = tree.end_leafs(); it != end; ++it) {
    if (!tree.isNodeOccupied(*it)) continue;
    const int n = 1 << (tree.getTreeDepth() - it.getDepth());  // of a pruned cell, along an edge
    const Eigen::Vector3d low = Eigen::Vector3d(it.getX(), it.getY(), it.getZ()).array() - (n - 1) * edge / 2;
    for (int z = 0; z < n; ++z)
      for (int y = 0; y < n; ++y)
        for (int x = 0; x < n; ++x) f(Eigen::Vector3d(low + edge * Eigen::Vector3d(x, y, z)), *it);
  }
}

constexpr const char* kPlyVertex =
    "property float x\nproperty float y\nproperty float z\n"
    "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar label\n";

void append_ply_vertex(BinaryWriter& bytes, const Eigen::Vector3d& p, const Node& node) {
  append_point(bytes, p);
  for (const std::uint8_t c : voxel_colour(node)) bytes.put(c);
  bytes.put(node.label());
}

std::string ply_header(const char* what, const MapClasses& classes) {
  return fmt::format("ply\nformat binary_little_endian 1.0\ncomment {} of a semantic octree, metres\n{}",
                     what, label_lines("comment", classes));
}

void write_geometry(const std::filesystem::path& path, const std::string& header, const BinaryWriter& data) {
  AtomicFile file(path);
  file.stream() << header << data.bytes();
  file.commit();
}

}  // namespace

void save_point_cloud(const SemanticOcTree& tree, const std::filesystem::path& path,
                      const MapClasses& classes) {
  const bool pcd = path.extension() == ".pcd";
  if (!pcd && path.extension() != ".ply")
    throw UsageError(fmt::format("'{}': a point cloud's extension is .ply or .pcd", path.string()));
  BinaryWriter data;
  std::size_t points = 0;
  for_each_occupied_voxel(tree, [&](const Eigen::Vector3d& centre, const Node& node) {
    ++points;
    if (!pcd) {
      append_ply_vertex(data, centre, node);
      return;
    }
    const Rgb c = voxel_colour(node);
    append_point(data, centre);
    data.put(std::uint32_t(c[0]) << 16 | std::uint32_t(c[1]) << 8 | std::uint32_t(c[2]));
    data.put(std::uint32_t(node.label()));
  });
  if (pcd) {
    write_geometry(
        path,
        fmt::format(
            "# .PCD v0.7 - Point Cloud Data file format\n# occupied voxels of a semantic octree, metres\n{}"
            "VERSION 0.7\nFIELDS x y z rgb label\nSIZE 4 4 4 4 4\nTYPE F F F F U\nCOUNT 1 1 1 1 1\n"
            "WIDTH {}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {}\nDATA binary\n",
            label_lines("#", classes), points, points),
        data);
  } else {
    write_geometry(path,
                   fmt::format("{}element vertex {}\n{}end_header\n", ply_header("occupied voxels", classes),
                               points, kPlyVertex),
                   data);
  }
}

std::size_t save_mesh(const SemanticOcTree& tree, const std::filesystem::path& path,
                      const MapClasses& classes) {
  if (path.extension() != ".ply")
    throw UsageError(fmt::format("'{}': a mesh's extension is .ply", path.string()));
  const OccupancySurface surface = occupancy_surface(tree);
  BinaryWriter data;
  for (std::size_t i = 0; i < surface.vertices.size(); ++i) {
    const VoxelKey& key = surface.voxels[i];
    const Node* node = tree.search(octomap::OcTreeKey(key[0], key[1], key[2]));
    append_ply_vertex(data, surface.vertices[i], *node);
  }
  for (const auto& triangle : surface.triangles) {
    data.put(std::uint8_t(3));
    for (const std::uint32_t vertex : triangle) data.put(vertex);
  }
  write_geometry(
      path,
      fmt::format(
          "{}element vertex {}\n{}element face {}\nproperty list uchar int vertex_indices\nend_header\n",
          ply_header("surface", classes), surface.vertices.size(), kPlyVertex, surface.triangles.size()),
      data);
  return surface.triangles.size();
}

}  // namespace dynslam::runtime
