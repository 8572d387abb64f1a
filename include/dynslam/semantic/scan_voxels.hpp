// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "dynslam/concepts/scalar.hpp"
#include "dynslam/semantic/label_histogram.hpp"
#include "dynslam/semantic/ray_bits.hpp"
#include "dynslam/semantic/ray_traversal.hpp"
#include "dynslam/semantic/voxel_end.hpp"
#include "dynslam/semantic/voxel_key.hpp"

namespace dynslam {

/// A surface sample of a scan, in the world [m].
struct ScanPoint {
  Eigen::Vector3f p;
  std::uint8_t label = 0;
  std::array<std::uint8_t, 3> rgb{};
};

/// 8 x 8 x 8 voxels of a scan; bits are in Morton order, so word o is the octant o, byte b of it the octant b
/// of that one, and so on: the three lowest levels of an octree.
struct ScanBlock {
  static constexpr int kLevel = 3;  ///< the block is one cell of this level
  PackedKey base = 0;               ///< lowest voxel
  std::array<std::uint64_t, 8> hit{}, miss{}, end_seen{};
  std::int32_t ends = -1;  ///< index of the block's table of surface voxels

  [[nodiscard]] VoxelKey key() const { return unpack(base); }
  /// `base` of the block that holds a voxel.
  [[nodiscard]] static constexpr PackedKey base_of(PackedKey voxel) {
    return voxel & ~(PackedKey(7) | PackedKey(7) << 21 | PackedKey(7) << 42);
  }
};

/// The voxels that one scan touches, each once: occupied where it ends, free where it passes (occupied wins).
///
/// Bits in hashed blocks instead of a set of keys: to note a voxel that is already known costs a nanosecond,
/// and the blocks come out in the order in which an octree stores them. Memory is kept from scan to scan.
/// @tparam N  number of labels, that of the map; samples of other labels count, without a vote
template <std::size_t N>
class BasicScanVoxels {
 public:
  using End = BasicVoxelEnd<N>;
  static constexpr std::size_t kLabels = N;

  explicit BasicScanVoxels(const VoxelGrid& grid) : grid_(grid) { clear(); }

  [[nodiscard]] const VoxelGrid& grid() const { return grid_; }

  /// Forgets the scan, keeps the memory.
  void clear() {
    blocks_.clear();
    tables_used_ = 0;
    ends_.clear();
    order_.clear();
    if (slots_.empty()) slots_.resize(std::size_t(1) << 12);
    std::fill(slots_.begin(), slots_.end(), Slot{});
    last_base_ = last_end_key_ = kNoBlock;
    last_low_ = last_high_ = Eigen::Vector3f::Zero();
  }

  /// Notes a surface sample. @param weight  0 to 1
  /// @return true when it is the voxel's first one in this scan; false, too, for a point outside the grid
  template <FixedMatrix<3> D>
  bool add_end(const Eigen::MatrixBase<D>& p, std::uint16_t label, const std::array<std::uint8_t, 3>& rgb,
               float weight = 1.0F) {
    const auto key = grid_.key(p);
    return key && add_end(*key, label, rgb, weight);
  }
  bool add_end(const VoxelKey& key, std::uint16_t label, const std::array<std::uint8_t, 3>& rgb,
               float weight = 1.0F) {
    const PackedKey packed = pack(key);
    bool first = false;
    if (packed != last_end_key_) {  // neighbouring pixels fall into one voxel
      ScanBlock& block = block_of(packed);
      const std::size_t i = index_in_block(packed);
      const std::uint64_t bit = std::uint64_t(1) << (i & 63);
      if (block.ends < 0) {
        block.ends = static_cast<std::int32_t>(tables_used_++);
        if (tables_used_ > tables_.size()) tables_.emplace_back();
      }
      std::uint32_t& index = tables_[static_cast<std::size_t>(block.ends)][i];
      first = (block.hit[i >> 6] & bit) == 0;
      if (first) {
        block.hit[i >> 6] |= bit;
        index = static_cast<std::uint32_t>(ends_.size());
        ends_.emplace_back();
      }
      last_end_key_ = packed;
      last_end_ = index;
      const Eigen::Vector3d centre = grid_.centre(key);
      // Less than half an edge, so that rounding cannot put a point of the next voxel in here.
      const Eigen::Vector3d half = Eigen::Vector3d::Constant(0.499 * grid_.resolution());
      last_low_ = (centre - half).cast<float>();
      last_high_ = (centre + half).cast<float>();
    }
    add_sample(ends_[last_end_], label, rgb, weight);
    return first;
  }
  /// Adds a sample to the voxel of the last add_end() when it certainly lies in it: neighbouring pixels
  /// mostly do, and to compare is cheaper than to compute the key. @return whether it was added
  bool add_to_last(const ScanPoint& point) {
    for (Eigen::Index i = 0; i < 3; ++i) {
      if (!(point.p(i) > last_low_(i) && point.p(i) < last_high_(i))) return false;
    }
    add_sample(ends_[last_end_], point.label, point.rgb, 1.0F);
    return true;
  }
  /// Whether add_end() has noted the voxel.
  [[nodiscard]] bool is_end(const VoxelKey& key) {
    const PackedKey packed = pack(key);
    if (packed == last_end_key_) return true;
    const std::size_t i = index_in_block(packed);
    return (block_of(packed).hit[i >> 6] >> (i & 63) & 1) != 0;
  }

  /// Notes that nothing is in the way from `origin` to `end`; the voxel of `end` itself is left out.
  /// @return false when an end lies outside the grid
  template <FixedMatrix<3> A, FixedMatrix<3> B>
  bool carve(const Eigen::MatrixBase<A>& origin, const Eigen::MatrixBase<B>& end) {
    PackedKey base = kNoBlock;
    std::uint64_t* miss = nullptr;
    return traverse_ray(grid_, origin, end, [&](PackedKey key) {
      if (ScanBlock::base_of(key) != base) {  // most steps stay in their block
        base = ScanBlock::base_of(key);
        miss = blocks_[find_or_add(base)].miss.data();
      }
      const std::size_t i = index_in_block(key);
      miss[i >> 6] |= std::uint64_t(1) << (i & 63);
    });
  }

  /// As carve() for many rays from one origin, in a third of the time.
  template <std::floating_point S>
  void carve_all(const Eigen::Matrix<S, 3, 1>& origin, std::span<const Eigen::Matrix<S, 3, 1>> ends) {
    if (!ray_bits_.carve(grid_, origin, ends)) {  // too large a box
      for (const auto& end : ends) carve(origin, end);
      return;
    }
    ray_bits_.drain([this](const VoxelKey& key, unsigned bits) {
      ScanBlock& block = block_of(pack(key));
      const std::size_t i = index_in_block(pack(key));
      // Along x a block has the places 0, 1, 8, 9 in one word and the same in the next.
      const auto spread = [](unsigned four) { return std::uint64_t((four & 3) | (four & 12) << 6); };
      block.miss[i >> 6] |= spread(bits & 15) << (i & 63);
      block.miss[(i >> 6) + 1] |= spread(bits >> 4) << (i & 63);
    });
  }

  /// As carve(), for many rays that end nearly together: only the first ray into each end voxel is followed.
  template <FixedMatrix<3> A, FixedMatrix<3> B>
  bool carve_once(const Eigen::MatrixBase<A>& origin, const Eigen::MatrixBase<B>& end) {
    const auto key = grid_.key(end);
    if (!key) return false;
    return mark_end(*key) ? carve(origin, end) : true;
  }
  /// Remembers that a ray ends in a voxel, without an observation. @return true for the first one
  bool mark_end(const VoxelKey& key) {
    const PackedKey packed = pack(key);
    const std::size_t i = index_in_block(packed);
    std::uint64_t& word = block_of(packed).end_seen[i >> 6];
    const std::uint64_t bit = std::uint64_t(1) << (i & 63);
    const bool first = (word & bit) == 0;
    word |= bit;
    return first;
  }

  /// Indices of the blocks along the Z-order curve, with `occupied wins` applied. Call once per scan, after
  /// the last ray.
  std::span<const std::uint32_t> finish() {
    codes_.clear();
    for (std::uint32_t b = 0; b < blocks_.size(); ++b) {
      ScanBlock& block = blocks_[b];
      std::uint64_t any = 0;
      for (std::size_t w = 0; w < 8; ++w) {
        block.miss[w] &= ~block.hit[w];
        any |= block.miss[w] | block.hit[w];
      }
      if (any != 0) codes_.push_back({morton_code(block.key()), b});
    }
    std::sort(codes_.begin(), codes_.end());
    order_.clear();
    for (const auto& [code, b] : codes_) order_.push_back(b);
    return order_;
  }
  /// What finish() returned.
  [[nodiscard]] std::span<const std::uint32_t> order() const { return order_; }

  [[nodiscard]] const ScanBlock& block(std::uint32_t b) const { return blocks_[b]; }
  /// Surface measurement of a voxel whose bit in `hit` is set. @param i  its place in the block
  [[nodiscard]] const End& end(const ScanBlock& block, std::size_t i) const {
    return ends_[tables_[static_cast<std::size_t>(block.ends)][i]];
  }
  /// Voxels with a surface sample.
  [[nodiscard]] std::size_t hits() const { return ends_.size(); }
  /// Voxels passed and not hit; after finish().
  [[nodiscard]] std::size_t misses() const {
    std::size_t n = 0;
    for (const std::uint32_t b : order_)
      for (const std::uint64_t word : blocks_[b].miss) n += static_cast<std::size_t>(std::popcount(word));
    return n;
  }

  /// Memory for the ends of rays, for those who gather them to carve_all().
  [[nodiscard]] std::vector<Eigen::Vector3f>& ray_ends() { return ray_ends_; }

  /// Place of a voxel within its block, in Morton order.
  [[nodiscard]] static std::size_t index_in_block(PackedKey key) {
    return kMorton[(key & 7) | (key >> 18 & 0x38) | (key >> 36 & 0x1C0)];
  }
  /// Inverse of index_in_block(): offsets within the block along x, y, z.
  [[nodiscard]] static VoxelKey offset_in_block(std::size_t i) {
    VoxelKey key;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::size_t j = i >> axis;
      key[axis] = static_cast<std::uint16_t>((j & 1) | (j >> 2 & 2) | (j >> 4 & 4));
    }
    return key;
  }

 private:
  using Table = std::array<std::uint32_t, 512>;
  struct Slot {
    PackedKey base = kNoBlock;
    std::uint32_t block = 0;
  };
  struct Code {
    std::uint64_t code;
    std::uint32_t block;
    bool operator<(const Code& other) const { return code < other.code; }
  };
  static void add_sample(End& end, std::uint16_t label, const std::array<std::uint8_t, 3>& rgb,
                         float weight) {
    if (label < N) ++end.label_samples[label];
    for (std::size_t c = 0; c < 3; ++c) end.colour_sum[c] += rgb[c];
    ++end.samples;
    end.weight = std::max(end.weight, weight);
  }

  static constexpr PackedKey kNoBlock = ~PackedKey(0);
  /// Row-major place in a block to place in Morton order.
  static constexpr std::array<std::uint16_t, 512> kMorton = [] {
    std::array<std::uint16_t, 512> table{};
    for (std::uint64_t i = 0; i < 512; ++i)
      table[i] = static_cast<std::uint16_t>(spread_bits(i & 7) | spread_bits(i >> 3 & 7) << 1 |
                                            spread_bits(i >> 6) << 2);
    return table;
  }();

  ScanBlock& block_of(PackedKey key) {
    const PackedKey base = ScanBlock::base_of(key);
    if (base != last_base_) {
      last_base_ = base;
      last_block_ = find_or_add(base);
    }
    return blocks_[last_block_];
  }

  std::uint32_t find_or_add(PackedKey base) {
    const std::size_t mask = slots_.size() - 1;
    for (std::size_t s = slot(base);; s = (s + 1) & mask) {
      if (slots_[s].base == base) return slots_[s].block;
      if (slots_[s].base != kNoBlock) continue;
      const auto b = static_cast<std::uint32_t>(blocks_.size());
      slots_[s] = {base, b};
      blocks_.emplace_back().base = base;
      if (blocks_.size() * 2 > slots_.size()) grow();
      return b;
    }
  }
  [[nodiscard]] std::size_t slot(PackedKey base) const {
    const int bits = std::countr_zero(slots_.size());
    return static_cast<std::size_t>((base >> 3) * 0x9E3779B97F4A7C15ULL >> (64 - bits));
  }
  void grow() {
    slots_.assign(2 * slots_.size(), Slot{});
    const std::size_t mask = slots_.size() - 1;
    for (std::uint32_t b = 0; b < blocks_.size(); ++b) {
      std::size_t s = slot(blocks_[b].base);
      while (slots_[s].base != kNoBlock) s = (s + 1) & mask;
      slots_[s] = {blocks_[b].base, b};
    }
  }

  VoxelGrid grid_;
  std::vector<ScanBlock> blocks_;
  std::vector<Slot> slots_;  // open addressing; a power of two
  PackedKey last_base_ = kNoBlock;
  std::uint32_t last_block_ = 0;
  PackedKey last_end_key_ = kNoBlock;
  std::uint32_t last_end_ = 0;
  Eigen::Vector3f last_low_ = Eigen::Vector3f::Zero(),
                  last_high_ = Eigen::Vector3f::Zero();  // well inside it
  std::vector<Table> tables_;
  std::size_t tables_used_ = 0;
  std::vector<End> ends_;
  std::vector<Code> codes_;
  RayBits ray_bits_;
  std::vector<Eigen::Vector3f> ray_ends_;
  std::vector<std::uint32_t> order_;
};

/// A scan for this library's own maps.
using ScanVoxels = BasicScanVoxels<kMapLabels>;

/// Gathers a scan by the rules of OctoMap's insertPointCloud, so that the same voxels are hit and missed:
/// points beyond `max_range` clear the way up to it, all others are hits; a ray is followed for each point,
/// or with `discretize` for each voxel that holds points, to its centre.
/// @param max_range  metres; below 0: unlimited
template <std::size_t N>
void gather_point_cloud(BasicScanVoxels<N>& scan, std::span<const ScanPoint> points,
                        const Eigen::Vector3f& origin, double max_range, bool discretize) {
  scan.clear();
  const VoxelGrid& grid = scan.grid();
  const auto norm = [](const Eigen::Vector3f& d) {
    return std::sqrt(static_cast<double>(d.x() * d.x() + d.y() * d.y() + d.z() * d.z()));
  };
  const auto in_range = [&](const Eigen::Vector3f& p) {
    return max_range < 0.0 || norm(p - origin) <= max_range;
  };
  const auto end_of_range = [&](const Eigen::Vector3f& p) -> Eigen::Vector3f {
    const Eigen::Vector3f d = p - origin;
    const Eigen::Vector3f direction = d / static_cast<float>(norm(d));
    return origin + direction * static_cast<float>(max_range);
  };
  std::vector<Eigen::Vector3f>& ends = scan.ray_ends();
  ends.clear();
  for (const ScanPoint& point : points) {
    if (!discretize) {
      const bool hit = in_range(point.p);
      if (hit) scan.add_end(point.p, point.label, point.rgb);
      ends.push_back(hit ? point.p : end_of_range(point.p));
      continue;
    }
    if (scan.add_to_last(point)) continue;
    const auto key = grid.key(point.p);
    if (!key) continue;
    if (scan.is_end(*key)) {
      scan.add_end(*key, point.label, point.rgb);
      continue;
    }
    const Eigen::Vector3f centre = grid.centre(*key).cast<float>();
    if (in_range(centre)) {
      scan.add_end(*key, point.label, point.rgb);
      ends.push_back(centre);
    } else if (scan.mark_end(*key)) {
      ends.push_back(end_of_range(centre));
    }
  }
  scan.carve_all(origin, std::span<const Eigen::Vector3f>(ends));
  scan.finish();
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
