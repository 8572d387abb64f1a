// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <unordered_map>

#include "dynslam/concepts/map.hpp"
#include "dynslam/semantic/cell_tree.hpp"
#include "dynslam/semantic/map_voxel.hpp"
#include "dynslam/semantic/scan_voxels.hpp"
#include "dynslam/semantic/voxel.hpp"

namespace dynslam {

/// Voxel store in hashed blocks of 8 x 8 x 8 voxels at full resolution, with summaries of coarser cells above
/// them. Plain where an octree of OctoMap's is compact; the oracle of that one's tests, and a map for
/// programs without OctoMap.
/// @tparam N  number of labels, 1 to 256; a voxel takes N bytes for them
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
      fuse(scan, from, blocks_[static_cast<std::size_t>(leaf.leaf())], leaf.summary);
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
      const auto* cell = finder_.find(key, std::max(level, Tree::kLeafLevel));
      if (cell == nullptr) return Occupancy::unknown;
      if (level >= Tree::kLeafLevel) return cell->summary.state(map_->params_);
      return map_->blocks_[static_cast<std::size_t>(cell->leaf())].state(first_in_block(key, level), level);
    }

   private:
    const VoxelBlockMap* map_;
    typename CellTree<S, N>::Finder finder_;
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
  using Summary = CellSummary<S, N>;
  using CellVoxel = SemanticVoxel<S, N>;
  struct Block {
    std::array<CellVoxel, 512> voxels;
    std::array<std::uint64_t, 8> known{}, occupied{};  // a bit for each voxel

    /// Of a cell within the block: its 1, 8 or 64 voxels lie side by side in a word.
    [[nodiscard]] Occupancy state(std::size_t first, int level) const {
      const std::uint64_t cell = (~std::uint64_t(0) >> (64 - (1 << (3 * level)))) << (first % 64);
      if ((occupied[first / 64] & cell) != 0) return Occupancy::occupied;
      return (known[first / 64] & cell) != 0 ? Occupancy::free : Occupancy::unknown;
    }
  };
  struct Hash {
    std::size_t operator()(PackedKey key) const {
      return static_cast<std::size_t>((key >> 3) * 0x9E3779B97F4A7C15ULL >> 16);
    }
  };

  /// Fuses one block and keeps its summary: votes by their differences, the largest log-odds anew where the
  /// voxel that had it sank.
  void fuse(const Scan& scan, const ScanBlock& from, Block& to, Summary& summary) const {
    bool sank = false;
    S highest = std::numeric_limits<S>::lowest();
    // Of word w the voxel of the lowest bit.
    const auto change = [&](std::size_t w, std::uint64_t bits, auto&& measure) {
      CellVoxel& voxel = to.voxels[64 * w + static_cast<std::size_t>(std::countr_zero(bits))];
      const S before = voxel.occupancy.log_odds();
      measure(voxel);
      const S after = voxel.occupancy.log_odds();
      const std::uint64_t bit = bits & -bits;
      to.occupied[w] = (to.occupied[w] & ~bit) | (bit & -std::uint64_t(after >= params_.occupied));
      sank = sank || (before == summary.log_odds && after < before);
      highest = std::max(highest, after);
    };
    for (std::size_t w = 0; w < 8; ++w) {
      to.known[w] |= from.miss[w] | from.hit[w];
      for (std::uint64_t bits = from.miss[w]; bits != 0; bits &= bits - 1) {
        change(w, bits, [&](CellVoxel& voxel) {
          voxel.miss(params_);
          // Labels belong to what is there: free space has none, and forgets those it had.
          if (voxel.occupancy.state(params_) == Occupancy::occupied || voxel.labels.empty()) return;
          count_votes(summary, voxel.labels, -1);
          voxel.labels.clear();
        });
      }
      for (std::uint64_t bits = from.hit[w]; bits != 0; bits &= bits - 1) {
        const std::size_t i = 64 * w + static_cast<std::size_t>(std::countr_zero(bits));
        change(w, bits, [&](CellVoxel& voxel) {
          const auto& end = scan.end(from, i);
          voxel.occupancy.update(static_cast<S>(end.weight) * params_.hit, params_);
          if (voxel.occupancy.state(params_) != Occupancy::occupied) return;
          count_votes(summary, voxel.labels, -1);
          end.vote(voxel.labels);
          count_votes(summary, voxel.labels, 1);
        });
      }
    }
    summary.observed = true;
    if (highest >= summary.log_odds) {
      summary.log_odds = highest;
    } else if (sank) {
      summary.log_odds = std::numeric_limits<S>::lowest();
      for (const CellVoxel& voxel : to.voxels) {
        if (voxel.occupancy.state(params_) != Occupancy::unknown)
          summary.log_odds = std::max(summary.log_odds, voxel.occupancy.log_odds());
      }
    }
  }
  static void count_votes(Summary& summary, const LabelHistogram<N>& labels, int sign) {
    for (std::size_t l = 0; l < N; ++l) summary.votes[l] += sign * labels.votes(static_cast<std::uint8_t>(l));
  }

  [[nodiscard]] static std::size_t first_in_block(const VoxelKey& key, int level) {
    return Scan::index_in_block(pack(key_at_level(key, level)));
  }
  /// A cell within a block, whose voxels lie side by side. @param first  place of its first voxel
  [[nodiscard]] MapVoxel cell_in_block(const Block& block, std::size_t first, int level) const {
    if (level == 0) {
      const CellVoxel& voxel = block.voxels[first];
      return {voxel.occupancy.state(params_), static_cast<float>(voxel.occupancy.log_odds()),
              voxel.labels.top(), static_cast<float>(voxel.labels.confidence())};
    }
    Summary sum;
    for (std::size_t i = first; i < first + (std::size_t(1) << (3 * level)); ++i)
      sum.add(block.voxels[i], params_);
    return sum.describe(params_);
  }
  template <class F>
  void for_each_in_block(const Block& block, const VoxelKey& corner, const VoxelKey& low,
                         const VoxelKey& high, int level, F& f) const {
    const std::size_t step = std::size_t(1) << (3 * level);
    for (std::size_t i = 0; i < block.voxels.size(); i += step) {
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
  Tree tree_;
};

static_assert(VoxelStore<VoxelBlockMap<float>> && VoxelStore<VoxelBlockMap<double>>);
static_assert(VoxelStore<VoxelBlockMap<float, 80>>);

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
