// SPDX-License-Identifier: BSD-3-Clause
// How good a map of the synthetic office is, from its triangles.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "dynslam/interop/octomap_semantic_tree.hpp"
#include "dynslam/runtime/io/mask_reader.hpp"
#include "dynslam/semantic/map_query.hpp"
#include "synth/synth_render.hpp"
#include "synth/synth_scene.hpp"

namespace dynslam::test {

/// Calls f(point) for points of a triangle, at most `step` metres apart.
template <class F>
void sample_triangle(const runtime::synth::Triangle& triangle, double step, F&& f) {
  const Eigen::Vector3d a = triangle.p[0], u = triangle.p[1] - a, v = triangle.p[2] - a;
  const int n = 1 + static_cast<int>(std::ceil(std::max(u.norm(), v.norm()) / step));
  for (int i = 0; i <= n; ++i) {
    for (int j = 0; i + j <= n; ++j) f(Eigen::Vector3d(a + u * i / n + v * j / n));
  }
}

/// Counts behind the figures of a map. A voxel is near a surface that comes within one edge of its centre:
/// the sensor's noise at some metres is half an edge of 5 cm, and walls may lie on the border of voxels.
struct MapScore {
  std::size_t occupied = 0;      ///< voxels of the map
  std::size_t on_surface = 0;    ///< of these: a static surface passes through the voxel
  std::size_t near_surface = 0;  ///< of these: a static surface passes near it
  std::size_t observed = 0;      ///< static surface voxels that an exact camera saw
  std::size_t found = 0;         ///< of these: occupied in the map
  std::size_t found_near = 0;    ///< of these: it or one that shares a face is occupied
  std::size_t in_swept = 0;  ///< occupied voxels where moving objects have been and no static surface is near
  std::array<std::size_t, 4> truth_of{},
      right_of{};  ///< per class: occupied voxels of it, of these labelled so
  std::array<std::size_t, 4> said_of{},
      rightly_of{};  ///< per class: voxels labelled so, of these with it near

  [[nodiscard]] double precision() const { return ratio(near_surface, occupied); }
  [[nodiscard]] double precision_exact() const { return ratio(on_surface, occupied); }
  [[nodiscard]] double recall() const { return ratio(found_near, observed); }
  [[nodiscard]] double recall_exact() const { return ratio(found, observed); }
  [[nodiscard]] double ghosts() const { return ratio(in_swept, occupied); }
  /// Share of a class's surface in the map that is labelled as the class.
  [[nodiscard]] double label_recall(runtime::Label l) const {
    return ratio(right_of[static_cast<std::size_t>(l)], truth_of[static_cast<std::size_t>(l)]);
  }
  /// Share of the voxels labelled as a class that lie on it.
  [[nodiscard]] double label_precision(runtime::Label l) const {
    return ratio(rightly_of[static_cast<std::size_t>(l)], said_of[static_cast<std::size_t>(l)]);
  }

 private:
  static double ratio(std::size_t a, std::size_t b) {
    return b == 0 ? 0.0 : static_cast<double>(a) / static_cast<double>(b);
  }
};

/// Truth of a scene, gathered instant by instant. The map's frame is the scene's world.
class MapTruth {
 public:
  explicit MapTruth(const VoxelGrid& grid) : grid_(grid) {}

  /// Static furniture: what carries neither a person's label nor moves. Call once.
  void add_static(std::span<const runtime::synth::Triangle> triangles) {
    for (const auto& t : triangles) {
      if (t.dynamic || t.label == runtime::Label::person) continue;
      sample_triangle(t, grid_.resolution() / 4, [&](const Eigen::Vector3d& p) {
        const auto key = grid_.key(p);
        if (!key) return;
        ++surface_[pack(*key)][static_cast<std::size_t>(t.label)];
        for_neighbours(pack(*key), [&](PackedKey k) {
          if ((grid_.centre(unpack(k)) - p).norm() <= grid_.resolution()) near_.insert(k);
        });
      });
    }
  }
  /// Where the moving objects of an instant are, and what an exact camera sees.
  void add_instant(std::span<const runtime::synth::Triangle> triangles,
                   const runtime::synth::Rendering& exact, const Pinhole<double>& camera,
                   const SE3<double>& T_w_c, double max_range) {
    add_movers(triangles);
    for (int v = 0; v < exact.depth.rows; ++v) {
      for (int u = 0; u < exact.depth.cols; ++u) {
        const float z = exact.depth.at<float>(v, u);
        if (!(z > 0.45F) || double(z) > max_range || exact.dynamic.at<std::uint8_t>(v, u) != 0) continue;
        if (exact.label.at<std::uint8_t>(v, u) == static_cast<std::uint8_t>(runtime::Label::person)) continue;
        const Eigen::Vector3d p = T_w_c * Eigen::Vector3d(camera.ray(Eigen::Vector2d(u, v)) * double(z));
        if (const auto key = grid_.key(p)) seen_.insert(pack(*key));
      }
    }
  }
  void add_movers(std::span<const runtime::synth::Triangle> triangles) {
    for (const auto& t : triangles) {
      if (!t.dynamic) continue;
      sample_triangle(t, grid_.resolution() / 2, [&](const Eigen::Vector3d& p) {
        if (const auto key = grid_.key(p)) swept_.insert(pack(*key));
      });
    }
  }

  [[nodiscard]] MapScore score(const interop::SemanticOcTree& tree) const {
    MapScore s;
    const VoxelKey low{{0, 0, 0}}, high{{65535, 65535, 65535}};
    tree.for_each_occupied(low, high, 0, [&](const VoxelKey& key, const MapVoxel& voxel) {
      const PackedKey packed = pack(key);
      ++s.occupied;
      const bool near = near_.contains(packed);
      s.near_surface += near ? 1 : 0;
      s.in_swept += !near && swept_.contains(packed) ? 1 : 0;
      if (const auto it = surface_.find(packed); it != surface_.end()) {
        ++s.on_surface;
        // Voxels that one class has to itself: in the others either answer is right.
        const auto owner = std::max_element(it->second.begin(), it->second.end());
        if (*owner * 10 >= 9 * (it->second[0] + it->second[1] + it->second[2] + it->second[3])) {
          const auto l = static_cast<std::size_t>(owner - it->second.begin());
          ++s.truth_of[l];
          s.right_of[l] += voxel.label == l ? 1 : 0;
        }
      }
      if (voxel.label < 4) {
        ++s.said_of[voxel.label];
        bool rightly = false;
        for_neighbours(packed, [&](PackedKey k) {
          const auto it = surface_.find(k);
          rightly = rightly || (it != surface_.end() && it->second[voxel.label] > 0);
        });
        s.rightly_of[voxel.label] += rightly ? 1 : 0;
      }
    });
    for (const PackedKey packed : seen_) {
      ++s.observed;
      s.found += tree.at(unpack(packed)).state == Occupancy::occupied ? 1 : 0;
      bool near = false;
      for_neighbours(packed, [&](PackedKey k) {
        const double distance = (grid_.centre(unpack(k)) - grid_.centre(unpack(packed))).norm();
        near =
            near || (distance < 1.1 * grid_.resolution() && tree.at(unpack(k)).state == Occupancy::occupied);
      });
      s.found_near += near ? 1 : 0;
    }
    return s;
  }

 private:
  template <class F>
  static void for_neighbours(PackedKey packed, F&& f) {
    const VoxelKey key = unpack(packed);
    for (int z = -1; z <= 1; ++z) {
      for (int y = -1; y <= 1; ++y) {
        for (int x = -1; x <= 1; ++x) {
          f(pack(VoxelKey{{static_cast<std::uint16_t>(key[0] + x), static_cast<std::uint16_t>(key[1] + y),
                           static_cast<std::uint16_t>(key[2] + z)}}));
        }
      }
    }
  }

  VoxelGrid grid_;
  std::unordered_map<PackedKey, std::array<std::size_t, 4>> surface_;  // samples per class
  std::unordered_set<PackedKey> near_, seen_, swept_;
};

}  // namespace dynslam::test
