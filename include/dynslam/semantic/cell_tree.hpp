// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "dynslam/config.hpp"
#include "dynslam/semantic/label_histogram.hpp"
#include "dynslam/semantic/log_odds.hpp"
#include "dynslam/semantic/map_voxel.hpp"
#include "dynslam/semantic/voxel_key.hpp"

namespace dynslam {

/// What the observed voxels of a cell are together: the largest log-odds and the sum of the votes.
template <std::floating_point S, std::size_t N>
struct CellSummary {
  bool observed = false;
  S log_odds = std::numeric_limits<S>::lowest();
  std::array<std::int64_t, N> votes{};

  /// A voxel of known log-odds belongs to it.
  void observe(S value) {
    observed = true;
    log_odds = std::max(log_odds, value);
  }
  /// @param sign  1 to add the votes of a voxel, -1 to take them back
  void count(const LabelHistogram<N>& labels, int sign = 1) {
    for (std::size_t l = 0; l < N; ++l) votes[l] += sign * labels.votes(static_cast<std::uint8_t>(l));
  }
  void add(const CellSummary& other) {
    observed = observed || other.observed;
    log_odds = std::max(log_odds, other.log_odds);
    for (std::size_t l = 0; l < N; ++l) votes[l] += other.votes[l];
  }
  [[nodiscard]] bool occupied(const LogOddsParams<S>& params) const {
    return observed && log_odds >= params.occupied;
  }
  [[nodiscard]] Occupancy state(const LogOddsParams<S>& params) const {
    if (!observed) return Occupancy::unknown;
    return occupied(params) ? Occupancy::occupied : Occupancy::free;
  }
  [[nodiscard]] MapVoxel describe(const LogOddsParams<S>& params) const {
    if (!observed) return {};
    const auto labels = LabelHistogram<N>::from_sums(votes);
    return {state(params), static_cast<float>(log_odds), labels.top(),
            static_cast<float>(labels.confidence())};
  }
};

/// Octree of summaries from the whole grid (level 16) down to blocks (level 3): what a coarse cell holds
/// without a look at its voxels, and where nothing is without a look at anything.
template <std::floating_point S, std::size_t N>
class CellTree {
 public:
  using Summary = CellSummary<S, N>;
  static constexpr int kLeafLevel = 3;
  static constexpr std::int32_t kNone = -1;

  struct Node {
    std::array<std::int32_t, 8> children{kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone};
    Summary summary;
    /// Of a leaf, which has no children: what it stands for, a number of the owner's.
    [[nodiscard]] std::int32_t& leaf() { return children[0]; }
    [[nodiscard]] std::int32_t leaf() const { return children[0]; }
  };

  /// Finds cells. It keeps the way to the last one, and goes the part that differs: cells of a ray, or of a
  /// descent, are neighbours. Valid until the tree changes.
  class Finder {
   public:
    explicit Finder(const CellTree& tree) : tree_(&tree) {}
    /// The cell of a level that holds a key; nullptr where nothing was observed.
    /// @param level  kLeafLevel to 16
    [[nodiscard]] const Node* find(const VoxelKey& key, int level) {
      DYNSLAM_ASSERT(level >= kLeafLevel && level <= kVoxelLevels, "a level of the tree");
      if (tree_->nodes_.empty()) return nullptr;
      const std::uint64_t code = morton_code(key);
      depth_ = std::min(depth_, common_depth(code, previous_));
      previous_ = code;
      const int depth = kVoxelLevels - level;
      while (depth_ < depth) {
        const std::int32_t next =
            tree_->node(path_[std::size_t(depth_)]).children[child_index(key, kVoxelLevels - depth_)];
        if (next == kNone) return nullptr;
        path_[std::size_t(++depth_)] = next;
      }
      return &tree_->node(path_[std::size_t(depth)]);
    }

   private:
    const CellTree* tree_;
    std::array<std::int32_t, kVoxelLevels - kLeafLevel + 1> path_{};  // from the root to `previous_`
    int depth_ = 0;
    std::uint64_t previous_ = 0;
  };

  /// One cell alone.
  [[nodiscard]] const Node* find(const VoxelKey& key, int level) const {
    return Finder(*this).find(key, level);
  }

  /// Calls f(corner, level, node) for the cells of at least `level` that are occupied and touch the keys
  /// [low, high], and goes no deeper than the cells for which it is called. In the order of the Z curve.
  template <class F>
  void for_each_occupied(const VoxelKey& low, const VoxelKey& high, int level, const LogOddsParams<S>& params,
                         F&& f) const {
    if (!nodes_.empty()) visit(0, kVoxelLevels, VoxelKey{}, {low, high, level, params}, f);
  }

  /// Changes leaves in the order of the Z curve; every node above them is summed up once, after the last of
  /// the leaves below it. Call finish() at the end.
  class Update {
   public:
    explicit Update(CellTree& tree) : tree_(tree) {
      if (tree_.nodes_.empty()) tree_.nodes_.emplace_back();
      path_[0] = 0;
    }
    /// The leaf that holds a key, made where it is missing. The reference holds until the next call.
    [[nodiscard]] Node& leaf(const VoxelKey& key) {
      const std::uint64_t code = morton_code(key);
      if (depth_ > 0) climb_to(std::min(depth_, common_depth(code, previous_)));
      previous_ = code;
      while (depth_ < kLeafDepth) {
        const std::size_t i = child_index(key, kVoxelLevels - depth_);
        std::int32_t next = tree_.node(path_[std::size_t(depth_)]).children[i];
        if (next == kNone) {
          next = tree_.add_node();
          tree_.node(path_[std::size_t(depth_)]).children[i] = next;
        }
        path_[std::size_t(++depth_)] = next;
      }
      return tree_.node(path_[kLeafDepth]);
    }
    void finish() {
      climb_to(0);
      if (tree_.nodes_.size() > 1) tree_.sum_up(0);
    }

   private:
    static constexpr int kLeafDepth = kVoxelLevels - kLeafLevel;
    void climb_to(int depth) {
      for (; depth_ > depth; --depth_) {
        if (depth_ < kLeafDepth) tree_.sum_up(path_[std::size_t(depth_)]);
      }
    }
    CellTree& tree_;
    std::array<std::int32_t, kLeafDepth + 1> path_{};
    int depth_ = 0;
    std::uint64_t previous_ = 0;
  };

 private:
  /// How far down the ways to two keys are the same, by their morton_code(): three bits to a level.
  [[nodiscard]] static int common_depth(std::uint64_t a, std::uint64_t b) {
    return kVoxelLevels - (static_cast<int>(std::bit_width(a ^ b)) + 2) / 3;
  }
  struct Box {
    const VoxelKey &low, &high;
    int level;
    const LogOddsParams<S>& params;
  };
  [[nodiscard]] static std::size_t child_index(const VoxelKey& key, int level) {
    const int bit = level - 1;
    return std::size_t(key[0] >> bit & 1) | std::size_t(key[1] >> bit & 1) << 1 |
           std::size_t(key[2] >> bit & 1) << 2;
  }
  [[nodiscard]] Node& node(std::int32_t n) { return nodes_[static_cast<std::size_t>(n)]; }
  [[nodiscard]] const Node& node(std::int32_t n) const { return nodes_[static_cast<std::size_t>(n)]; }

  /// Grows by a quarter: doubled, nodes would take a tenth of a block map's memory.
  [[nodiscard]] std::int32_t add_node() {
    const std::size_t n = nodes_.size();
    if (n == nodes_.capacity()) nodes_.reserve(n + n / 4 + 16);
    nodes_.emplace_back();
    return static_cast<std::int32_t>(n);
  }
  void sum_up(std::int32_t n) {
    Summary sum;
    for (const std::int32_t child : node(n).children)
      if (child != kNone) sum.add(node(child).summary);
    node(n).summary = sum;
  }

  template <class F>
  void visit(std::int32_t n, int level, const VoxelKey& corner, const Box& box, F& f) const {
    const int edge = 1 << level;
    for (std::size_t a = 0; a < 3; ++a)
      if (int(corner[a]) > int(box.high[a]) || int(corner[a]) + edge <= int(box.low[a])) return;
    if (!node(n).summary.occupied(box.params)) return;
    if (level <= std::max(box.level, kLeafLevel)) {
      f(corner, level, node(n));
      return;
    }
    for (std::size_t i = 0; i < 8; ++i) {
      const std::int32_t child = node(n).children[i];
      if (child == kNone) continue;
      VoxelKey next = corner;
      for (std::size_t a = 0; a < 3; ++a)
        if ((i >> a & 1) != 0) next[a] = static_cast<std::uint16_t>(next[a] + edge / 2);
      visit(child, level - 1, next, box, f);
    }
  }

  std::vector<Node> nodes_;  // the root is the first
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
