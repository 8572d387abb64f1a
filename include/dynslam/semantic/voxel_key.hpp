// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <compare>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "dynslam/concepts/scalar.hpp"
#include "dynslam/config.hpp"

namespace dynslam {

/// Address of a voxel: counts of voxels along x, y, z. The numbers are those of OctoMap (depth 16): 32768 is
/// the voxel whose lower face is the plane 0.
struct VoxelKey {
  std::array<std::uint16_t, 3> k{};
  [[nodiscard]] constexpr std::uint16_t operator[](std::size_t i) const { return k[i]; }
  [[nodiscard]] constexpr std::uint16_t& operator[](std::size_t i) { return k[i]; }
  constexpr auto operator<=>(const VoxelKey&) const = default;
};

/// Depth of the octree that the keys address: 2^16 voxels along each axis.
inline constexpr int kVoxelLevels = 16;

/// A key in one word: 21 bits per axis (16 used), so that a step along an axis is one addition.
using PackedKey = std::uint64_t;

/// A key as one word.
[[nodiscard]] constexpr PackedKey pack(const VoxelKey& key) {
  return PackedKey(key[0]) | PackedKey(key[1]) << 21 | PackedKey(key[2]) << 42;
}
/// The key that pack() made a word of.
[[nodiscard]] constexpr VoxelKey unpack(PackedKey p) {
  return {{static_cast<std::uint16_t>(p & 0xFFFF), static_cast<std::uint16_t>(p >> 21 & 0xFFFF),
           static_cast<std::uint16_t>(p >> 42 & 0xFFFF)}};
}

/// Bits of x spread to every third place: ...cba -> ...c00b00a (x of 16 bits).
[[nodiscard]] constexpr std::uint64_t spread_bits(std::uint64_t x) {
  x &= 0xFFFF;
  x = (x | x << 16) & 0x0000FF0000FFULL;
  x = (x | x << 8) & 0x00F00F00F00FULL;
  x = (x | x << 4) & 0x0C30C30C30C3ULL;
  x = (x | x << 2) & 0x249249249249ULL;
  return x;
}

/// Place of a voxel on the Z-order curve: its path from the octree's root, three bits per level, x lowest.
[[nodiscard]] constexpr std::uint64_t morton_code(const VoxelKey& key) {
  return spread_bits(key[0]) | spread_bits(key[1]) << 1 | spread_bits(key[2]) << 2;
}

/// The cell of 2^level voxels along each edge that a voxel belongs to, named by its lowest voxel.
[[nodiscard]] constexpr VoxelKey key_at_level(const VoxelKey& key, int level) {
  VoxelKey out;
  for (std::size_t i = 0; i < 3; ++i) out[i] = static_cast<std::uint16_t>(key[i] >> level << level);
  return out;
}

/// A regular grid of cubes with its origin at a corner between cubes: points [m] to keys and back.
class VoxelGrid {
 public:
  /// @param resolution  edge of a voxel [m], above 0
  explicit VoxelGrid(double resolution) : resolution_(resolution), factor_(1.0 / resolution) {
    DYNSLAM_ASSERT(resolution > 0, "the edge of a voxel is above 0");
  }

  [[nodiscard]] double resolution() const { return resolution_; }
  /// Edge of a cell of the given level [m]; level 0 is the voxel.
  [[nodiscard]] double edge(int level = 0) const { return resolution_ * voxels(level); }

  /// Key of the voxel that holds a point; nullopt outside the grid (or NaN). Computed in double whatever the
  /// point's type, as OctoMap does.
  template <class D>
    requires FixedMatrix<D, 3, 1>
  [[nodiscard]] std::optional<VoxelKey> key(const Eigen::MatrixBase<D>& p) const {
    VoxelKey key;
    for (Eigen::Index i = 0; i < 3; ++i) {
      const double scaled = factor_ * static_cast<double>(p(i));
      if (!(scaled >= -kHalf && scaled < kHalf)) return std::nullopt;
      // floor() by truncation: without SSE 4.1 std::floor is a call.
      const int truncated = static_cast<int>(scaled);
      key[static_cast<std::size_t>(i)] =
          static_cast<std::uint16_t>(truncated - (scaled < truncated ? 1 : 0) + 32768);
    }
    return key;
  }

  /// Centre of a voxel along one axis [m].
  [[nodiscard]] double centre(std::uint16_t k) const {
    return (static_cast<double>(int(k) - 32768) + 0.5) * resolution_;
  }
  /// Centre of a cell of the given level [m].
  [[nodiscard]] Eigen::Vector3d centre(const VoxelKey& key, int level = 0) const {
    const VoxelKey low = key_at_level(key, level);
    Eigen::Vector3d c;
    for (std::size_t i = 0; i < 3; ++i)
      c(static_cast<Eigen::Index>(i)) = (int(low[i]) - 32768 + voxels(level) / 2) * resolution_;
    return c;
  }

  bool operator==(const VoxelGrid&) const = default;

 private:
  static constexpr double kHalf = 32768.0;
  /// Voxels along an edge of a cell; std::ldexp is a call.
  [[nodiscard]] static double voxels(int level) { return static_cast<double>(std::uint32_t(1) << level); }
  double resolution_, factor_;
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
