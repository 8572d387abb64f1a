// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <unordered_map>

#include "dynslam/concepts/map.hpp"
#include "dynslam/semantic/map_voxel.hpp"
#include "dynslam/semantic/scan_voxels.hpp"
#include "dynslam/semantic/voxel.hpp"

namespace dynslam {

/// Reference voxel store: hashed blocks of 8 x 8 x 8 voxels at full resolution. Plain where an octree is
/// compact; the oracle of the octree's tests, and a map for programs without OctoMap.
template <std::floating_point S>
class VoxelBlockMap {
 public:
  using Key = VoxelKey;
  using Scan = ScanVoxels;
  using Voxel = MapVoxel;

  explicit VoxelBlockMap(const VoxelGrid& grid, const LogOddsParams<S>& params = {})
      : grid_(grid), params_(params) {}

  [[nodiscard]] const VoxelGrid& grid() const { return grid_; }
  [[nodiscard]] const LogOddsParams<S>& params() const { return params_; }
  [[nodiscard]] std::size_t blocks() const { return blocks_.size(); }

  /// Fuses a scan, each of its voxels once (Eq 12).
  void integrate(const ScanVoxels& scan) {
    for (const std::uint32_t b : scan.order()) {
      const ScanBlock& from = scan.block(b);
      Block& to = blocks_[from.base];
      for (std::size_t w = 0; w < 8; ++w) {
        for (std::uint64_t bits = from.miss[w]; bits != 0; bits &= bits - 1) {
          SemanticVoxel<S, kMapLabels>& voxel = to[64 * w + static_cast<std::size_t>(std::countr_zero(bits))];
          voxel.miss(params_);
          // Labels belong to what is there: free space has none, and forgets those it had.
          if (voxel.occupancy.state(params_) != Occupancy::occupied) voxel.labels.clear();
        }
        for (std::uint64_t bits = from.hit[w]; bits != 0; bits &= bits - 1) {
          const std::size_t i = 64 * w + static_cast<std::size_t>(std::countr_zero(bits));
          SemanticVoxel<S, kMapLabels>& voxel = to[i];
          const VoxelEnd& end = scan.end(from, i);
          voxel.occupancy.update(static_cast<S>(end.weight) * params_.hit, params_);
          if (voxel.occupancy.state(params_) == Occupancy::occupied) end.vote(voxel.labels);
        }
      }
    }
  }

  [[nodiscard]] MapVoxel at(const VoxelKey& key, int level = 0) const {
    if (level == 0) {
      const auto* voxel = find(key);
      return voxel == nullptr ? MapVoxel{} : describe(*voxel);
    }
    Merged merged;
    visit_cell(key, level,
               [&](const VoxelKey&, const SemanticVoxel<S, kMapLabels>& v) { merged.add(v, params_); });
    return merged.result(params_);
  }

  template <class F>
  void for_each_occupied(const VoxelKey& low, const VoxelKey& high, int level, F&& f) const {
    std::unordered_map<PackedKey, Merged> cells;
    for (const auto& [base, block] : blocks_) {
      const VoxelKey corner = unpack(base);
      for (std::size_t i = 0; i < block.size(); ++i) {
        if (block[i].occupancy.state(params_) == Occupancy::unknown) continue;
        const VoxelKey offset = ScanVoxels::offset_in_block(i);
        VoxelKey key;
        for (std::size_t a = 0; a < 3; ++a) key[a] = static_cast<std::uint16_t>(corner[a] + offset[a]);
        const VoxelKey cell = key_at_level(key, level);
        bool inside = true;
        for (std::size_t a = 0; a < 3; ++a)
          inside = inside && cell[a] <= high[a] && int(cell[a]) + (1 << level) > int(low[a]);
        if (inside) cells[pack(cell)].add(block[i], params_);
      }
    }
    for (const auto& [cell, merged] : cells) {
      const MapVoxel voxel = merged.result(params_);
      if (voxel.state == Occupancy::occupied) f(unpack(cell), voxel);
    }
  }

 private:
  using Block = std::array<SemanticVoxel<S, kMapLabels>, 512>;
  struct Hash {
    std::size_t operator()(PackedKey key) const {
      return static_cast<std::size_t>((key >> 3) * 0x9E3779B97F4A7C15ULL >> 16);
    }
  };
  struct Merged {
    bool observed = false;
    S log_odds{};
    std::array<int, kMapLabels> votes{};
    void add(const SemanticVoxel<S, kMapLabels>& v, const LogOddsParams<S>& params) {
      const Occupancy state = v.occupancy.state(params);
      if (state == Occupancy::unknown) return;
      log_odds = observed ? std::max(log_odds, v.occupancy.log_odds()) : v.occupancy.log_odds();
      observed = true;
      for (std::uint8_t l = 0; l < kMapLabels; ++l) votes[l] += v.labels.votes(l);
    }
    [[nodiscard]] MapVoxel result(const LogOddsParams<S>& params) const {
      if (!observed) return {};
      const auto labels = MapLabels::from_sums(votes);
      return {log_odds >= params.occupied ? Occupancy::occupied : Occupancy::free,
              static_cast<float>(log_odds), labels.top(), static_cast<float>(labels.confidence())};
    }
  };

  [[nodiscard]] const SemanticVoxel<S, kMapLabels>* find(const VoxelKey& key) const {
    const PackedKey packed = pack(key);
    const auto it = blocks_.find(pack(key_at_level(key, ScanBlock::kLevel)));
    return it == blocks_.end() ? nullptr : &it->second[ScanVoxels::index_in_block(packed)];
  }
  [[nodiscard]] MapVoxel describe(const SemanticVoxel<S, kMapLabels>& v) const {
    return {v.occupancy.state(params_), static_cast<float>(v.occupancy.log_odds()), v.labels.top(),
            static_cast<float>(v.labels.confidence())};
  }
  template <class F>
  void visit_cell(const VoxelKey& key, int level, F&& f) const {
    const VoxelKey cell = key_at_level(key, level);
    const int n = 1 << level;
    for (int z = 0; z < n; ++z) {
      for (int y = 0; y < n; ++y) {
        for (int x = 0; x < n; ++x) {
          const VoxelKey k{{static_cast<std::uint16_t>(cell[0] + x), static_cast<std::uint16_t>(cell[1] + y),
                            static_cast<std::uint16_t>(cell[2] + z)}};
          if (const auto* voxel = find(k)) f(k, *voxel);
        }
      }
    }
  }

  VoxelGrid grid_;
  LogOddsParams<S> params_;
  std::unordered_map<PackedKey, Block, Hash> blocks_;
};

static_assert(VoxelStore<VoxelBlockMap<float>> && VoxelStore<VoxelBlockMap<double>>);

}  // namespace dynslam
