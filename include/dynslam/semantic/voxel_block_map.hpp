// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <deque>
#include <unordered_map>
#include <vector>

#include "dynslam/concepts/map.hpp"
#include "dynslam/semantic/cell_tree.hpp"
#include "dynslam/semantic/map_voxel.hpp"
#include "dynslam/semantic/scan_voxels.hpp"
#include "dynslam/semantic/voxel_block.hpp"

namespace dynslam {

/// Voxel store in blocks of 8 x 8 x 8 voxels at full resolution (VoxelBlock), with summaries of coarser cells
/// above them. The oracle of the octree's tests, and a map for programs without OctoMap.
/// @tparam N  number of labels, 1 to 256; an occupied voxel takes N bytes for them
template <std::floating_point S, std::size_t N = kMapLabels>
class VoxelBlockMap {
 public:
  using Key = VoxelKey;
  using Scan = BasicScanVoxels<N>;
  using Voxel = MapVoxel;
  static constexpr std::size_t kLabels = N;

  explicit VoxelBlockMap(const VoxelGrid& grid, const LogOddsParams<S>& params = {})
      : grid_(grid), params_(params) {}

  [[nodiscard]] const VoxelGrid& grid() const { return grid_; }
  [[nodiscard]] const LogOddsParams<S>& params() const { return params_; }
  [[nodiscard]] std::size_t blocks() const { return blocks_.size(); }

  /// Fuses a scan gathered on the same grid, after its finish(): each of its voxels once (Eq 12).
  void integrate(const Scan& scan) {
    if (scan.order().empty()) return;
    typename Tree::Update update(tree_);
    for (const std::uint32_t b : scan.order()) {
      const ScanBlock& from = scan.block(b);
      auto& leaf = update.leaf(from.key());
      if (leaf.leaf() == Tree::kNone) {
        leaf.leaf() = static_cast<std::int32_t>(blocks_.size());
        index_.emplace(from.base, blocks_.size());
        blocks_.emplace_back();
      }
      blocks_[static_cast<std::size_t>(leaf.leaf())].fuse(scan, from, params_, leaf.summary, scratch_);
    }
    update.finish();
  }

  /// State of the cell of 2^level voxels per edge that holds the key. Costs a look-up, not a look at each
  /// voxel.
  /// @param level  0 to 16
  [[nodiscard]] MapVoxel at(const VoxelKey& key, int level = 0) const {
    if (level >= Tree::kLeafLevel) {
      const auto* cell = tree_.find(key, level);
      return cell == nullptr ? MapVoxel{} : cell->summary.describe(params_);
    }
    const auto found = index_.find(pack(key_at_level(key, ScanBlock::kLevel)));
    if (found == index_.end()) return {};
    return cell_in_block(blocks_[found->second], first_in_block(key, level), level);
  }

  /// Asks for the states of many cells. It keeps the way to the last one: of neighbours that is next to all
  /// of it. Valid until the map changes.
  class Reader {
   public:
    explicit Reader(const VoxelBlockMap& map) : map_(&map), finder_(map.tree_) {}
    /// at(key, level).state, without the label. @param level  0 to 16
    [[nodiscard]] Occupancy state(const VoxelKey& key, int level) {
      if (level >= Tree::kLeafLevel) {
        const auto* cell = finder_.find(key, level);
        return cell == nullptr ? Occupancy::unknown : cell->summary.state(map_->params_);
      }
      const VoxelBlock<S, N>* block = block_of(pack(key));
      return block == nullptr ? Occupancy::unknown : block->state(first_in_block(key, level), level);
    }
    /// Of a voxel, in fewer steps.
    [[nodiscard]] Occupancy state(PackedKey key) {
      const VoxelBlock<S, N>* block = block_of(key);
      return block == nullptr ? Occupancy::unknown : block->state(Scan::index_in_block(key));
    }

   private:
    /// Most steps stay in their block.
    [[nodiscard]] const VoxelBlock<S, N>* block_of(PackedKey key) {
      const PackedKey base = ScanBlock::base_of(key);
      if (base != base_) [[unlikely]] {
        const auto* cell = finder_.find(unpack(base), Tree::kLeafLevel);
        base_ = base;
        block_ = cell == nullptr ? nullptr : &map_->blocks_[static_cast<std::size_t>(cell->leaf())];
      }
      return block_;
    }

    const VoxelBlockMap* map_;
    typename CellTree<S, N>::Finder finder_;
    PackedKey base_ = ~PackedKey(0);  // of the last block; at first of none
    const VoxelBlock<S, N>* block_ = nullptr;
  };

  template <class F>
  void for_each_occupied(const VoxelKey& low, const VoxelKey& high, int level, F&& f) const {
    const auto visit = [&](const VoxelKey& corner, int, const typename Tree::Node& node) {
      if (level >= Tree::kLeafLevel) {
        f(corner, node.summary.describe(params_));
      } else {
        for_each_in_block(blocks_[static_cast<std::size_t>(node.leaf())], corner, low, high, level, f);
      }
    };
    tree_.for_each_occupied(low, high, level, params_, visit);
  }

 private:
  using Tree = CellTree<S, N>;
  using Block = VoxelBlock<S, N>;
  struct Hash {
    std::size_t operator()(PackedKey key) const {
      return static_cast<std::size_t>((key >> 3) * 0x9E3779B97F4A7C15ULL >> 16);
    }
  };

  [[nodiscard]] static std::size_t first_in_block(const VoxelKey& key, int level) {
    return Scan::index_in_block(pack(key_at_level(key, level)));
  }
  /// A cell within a block, whose voxels lie side by side. @param first  place of its first voxel
  [[nodiscard]] MapVoxel cell_in_block(const Block& block, std::size_t first, int level) const {
    if (level > 0) return block.summary(first, level).describe(params_);
    const Occupancy state = block.state(first, 0);
    if (state != Occupancy::occupied) return {state, static_cast<float>(block.log_odds(first)), 0, 0.0F};
    const auto labels = block.labels(first);
    return {state, static_cast<float>(block.log_odds(first)), labels.top(),
            static_cast<float>(labels.confidence())};
  }
  template <class F>
  void for_each_in_block(const Block& block, const VoxelKey& corner, const VoxelKey& low,
                         const VoxelKey& high, int level, F& f) const {
    const std::size_t step = std::size_t(1) << (3 * level);
    for (std::size_t i = 0; i < Block::kVoxels; i += step) {
      if (block.state(i, level) != Occupancy::occupied) continue;
      const VoxelKey offset = Scan::offset_in_block(i);
      VoxelKey key;
      bool inside = true;
      for (std::size_t a = 0; a < 3; ++a) {
        key[a] = static_cast<std::uint16_t>(corner[a] + offset[a]);
        inside = inside && key[a] <= high[a] && int(key[a]) + (1 << level) > int(low[a]);
      }
      if (!inside) continue;
      f(key, cell_in_block(block, i, level));
    }
  }

  VoxelGrid grid_;
  LogOddsParams<S> params_;
  std::deque<Block> blocks_;  // blocks are large: they stay where they are
  std::unordered_map<PackedKey, std::size_t, Hash> index_;
  std::vector<typename Block::Labels> scratch_;
  Tree tree_;
};

static_assert(VoxelStore<VoxelBlockMap<float>> && VoxelStore<VoxelBlockMap<double>>);
static_assert(VoxelStore<VoxelBlockMap<float, 80>>);

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
