// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

// How a scan is fused into a semantic octree: cell by cell along the Z curve, every inner node once.

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "dynslam/interop/octomap_semantic_tree.hpp"

namespace dynslam::interop {

template <std::size_t N>
template <int level>
bool BasicSemanticOcTree<N>::update_cell(Node* node, bool created, const Part& part) {
  if constexpr (level == 0) {
    if (bits_of<0>(part.block.hit, part.first) != 0) {
      hit(*node, part.scan.end(part.block, part.first));
      return true;
    }
    return miss(*node);
  } else {
    if (node->children == nullptr) {
      // One value for the whole cell: where every voxel of it was passed, it stays one.
      bool any_hit = false, all_missed = true;
      if constexpr (level == 3) {
        for (std::size_t w = 0; w < 8; ++w) {
          any_hit = any_hit || part.block.hit[w] != 0;
          all_missed = all_missed && part.block.miss[w] == ~std::uint64_t(0);
        }
      } else {
        constexpr std::uint64_t full = level == 2 ? ~std::uint64_t(0) : 0xFF;
        any_hit = bits_of<level>(part.block.hit, part.first) != 0;
        all_missed = bits_of<level>(part.block.miss, part.first) == full;
      }
      if (all_missed) return miss(*node) || created;
      if (!created) {
        if (!any_hit && saturated_free(*node)) return false;
        expandNode(node);
      }
    }
    bool changed = false;
    constexpr std::size_t voxels = std::size_t(1) << (3 * (level - 1));  // of a child
    for (unsigned i = 0; i < 8; ++i) {
      const Part below{part.scan, part.block, part.first + i * voxels};
      std::uint64_t touched = 0;
      if constexpr (level == 3) {
        touched = part.block.hit[i] | part.block.miss[i];
      } else {
        touched = bits_of<level - 1>(part.block.hit, below.first) |
                  bits_of<level - 1>(part.block.miss, below.first);
      }
      if (touched == 0) continue;
      const bool missing = node->children == nullptr || node->children[i] == nullptr;
      Node* next = missing ? createNodeChild(node, i) : child(node, i);
      changed = update_cell<level - 1>(next, missing, below) || missing || changed;
    }
    if (changed) refresh(node);
    return changed;
  }
}

template <std::size_t N>
void BasicSemanticOcTree<N>::integrate(const Scan& scan) {
  if (scan.order().empty()) return;
  size_changed = true;
  bool created_root = false;
  if (root == nullptr) {
    root = new Node();
    ++tree_size;
    created_root = true;
  }
  constexpr int kBlockDepth = kVoxelLevels - ScanBlock::kLevel;
  std::array<Node*, kBlockDepth + 1> path{};
  std::array<bool, kBlockDepth + 1> dirty{};
  path[0] = root;
  int depth = 0;  // of the deepest valid entry of `path`
  std::uint64_t previous = 0;

  // Consecutive blocks share their path from the root; a node is refreshed when the last block below it is
  // done.
  const auto climb_to = [&](int target) {
    for (; depth > target; --depth) {
      if (!dirty[std::size_t(depth)]) continue;
      if (depth < kBlockDepth)
        refresh(path[std::size_t(depth)]);  // update_cell() has refreshed the block itself
      dirty[std::size_t(depth)] = false;
      dirty[std::size_t(depth - 1)] = true;
    }
  };
  for (const std::uint32_t b : scan.order()) {
    const ScanBlock& block = scan.block(b);
    const VoxelKey key = block.key();
    const std::uint64_t code = morton_code(key);
    if (depth > 0) {
      const auto differing = static_cast<int>(std::bit_width(code ^ previous));  // in bits; three to a level
      climb_to(std::min(depth, kVoxelLevels - (differing + 2) / 3));
    }
    previous = code;
    bool created = created_root && depth == 0 && path[0]->children == nullptr;
    bool skip = false;
    while (depth < kBlockDepth) {
      Node* node = path[std::size_t(depth)];
      const auto i = static_cast<unsigned>(code >> (3 * (kVoxelLevels - 1 - depth)) & 7);
      if (node->children == nullptr && !created) {
        // A pruned cell. Where it is as free as can be, passing through again says nothing new.
        if (saturated_free(*node) && block.ends < 0) {
          skip = true;
          break;
        }
        expandNode(node);
      }
      created = node->children == nullptr || node->children[i] == nullptr;
      Node* next = created ? createNodeChild(node, i) : child(node, i);
      path[std::size_t(++depth)] = next;
      dirty[std::size_t(depth)] = false;
    }
    if (skip) continue;
    if (update_cell<ScanBlock::kLevel>(path[kBlockDepth], created, {scan, block, 0}) || created)
      dirty[kBlockDepth] = true;
  }
  climb_to(0);
  if (dirty[0]) refresh(root);
}

}  // namespace dynslam::interop

#include "dynslam/pop_macros.hpp"
