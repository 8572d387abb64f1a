// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <octomap/OcTreeNode.h>
#include <octomap/OccupancyOcTreeBase.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>

#include "dynslam/concepts/map.hpp"
#include "dynslam/semantic/label_histogram.hpp"
#include "dynslam/semantic/map_voxel.hpp"
#include "dynslam/semantic/scan_voxels.hpp"
#include "dynslam/semantic/voxel_key.hpp"

namespace dynslam::interop {

class SemanticOcTree;

/// Node of a SemanticOcTree: log-odds, votes for labels, mean colour. 24 bytes, in a heap cell of the size
/// that ColorOcTree's 16 bytes take, too (glibc).
///
/// Free space carries neither label nor colour: what a voxel's votes said belongs to what was there.
class SemanticOcTreeNode : public octomap::OcTreeNode {
 public:
  using Colour = std::array<std::uint8_t, 3>;  // R, G, B

  SemanticOcTreeNode() = default;
  /// Deep copy: OctoMap's own would make children of the base type.
  SemanticOcTreeNode(const SemanticOcTreeNode& other)
      : octomap::OcTreeNode(), labels_(other.labels_), colour_(other.colour_), scans_(other.scans_) {
    value = other.value;
    if (other.children == nullptr) return;
    children = new octomap::AbstractOcTreeNode*[8];
    for (std::size_t i = 0; i < 8; ++i) {
      children[i] = other.children[i] == nullptr
                        ? nullptr
                        : new SemanticOcTreeNode(*static_cast<const SemanticOcTreeNode*>(other.children[i]));
    }
  }
  SemanticOcTreeNode& operator=(const SemanticOcTreeNode&) = delete;
  ~SemanticOcTreeNode() = default;

  /// Same data; children are not looked at.
  bool operator==(const SemanticOcTreeNode& other) const {
    return value == other.value && labels_ == other.labels_ && colour_ == other.colour_;
  }
  void copyData(const SemanticOcTreeNode& from) {
    value = from.value;
    labels_ = from.labels_;
    colour_ = from.colour_;
    scans_ = from.scans_;
  }

  [[nodiscard]] const MapLabels& labels() const { return labels_; }
  [[nodiscard]] const Colour& colour() const { return colour_; }
  [[nodiscard]] bool labelled() const { return !labels_.empty(); }
  [[nodiscard]] std::uint8_t label() const { return labels_.top(); }

  /// Adds one scan's votes and colour.
  void observe(const VoxelEnd& end) {
    end.vote(labels_);
    // Running mean; from the eighth scan on it forgets, so that a changed thing changes its colour.
    scans_ = static_cast<std::uint8_t>(std::min<int>(scans_ + 1, 8));
    const Colour seen = end.colour();
    for (std::size_t c = 0; c < 3; ++c) {
      const int difference = int(seen[c]) - int(colour_[c]);
      const int n = scans_;
      colour_[c] =
          static_cast<std::uint8_t>(colour_[c] + (2 * difference + (difference < 0 ? -n : n)) / (2 * n));
    }
  }
  void forget_labels() {
    labels_.clear();
    colour_ = {};
    scans_ = 0;
  }

  /// Parent from children: the largest log-odds (as OctoMap), the sum of the votes, the mean colour of the
  /// labelled. Hides the base's function, so OctoMap's own updates carry labels, too.
  void updateOccupancyChildren() { fuse_children(1); }

  std::istream& readData(std::istream& s);
  std::ostream& writeData(std::ostream& s) const;

 private:
  friend class SemanticOcTree;

  void fuse_children(int divisor) {
    float largest = -std::numeric_limits<float>::max();
    std::array<int, kMapLabels> votes{};
    std::array<int, 3> colour{};
    int coloured = 0;
    if (children != nullptr) {
      for (std::size_t i = 0; i < 8; ++i) {
        if (children[i] == nullptr) continue;
        const auto& child = *static_cast<const SemanticOcTreeNode*>(children[i]);
        largest = std::max(largest, child.value);
        if (child.scans_ == 0) continue;
        ++coloured;
        for (std::size_t l = 0; l < kMapLabels; ++l)
          votes[l] += child.labels_.votes(static_cast<std::uint8_t>(l));
        for (std::size_t c = 0; c < 3; ++c) colour[c] += child.colour_[c];
      }
    }
    value = largest;
    if (coloured == 0) {
      forget_labels();
      return;
    }
    labels_ = MapLabels::from_sums(votes, divisor);
    for (std::size_t c = 0; c < 3; ++c)
      colour_[c] = static_cast<std::uint8_t>((colour[c] + coloured / 2) / coloured);
    scans_ = 8;
  }

  MapLabels labels_;
  Colour colour_{};
  std::uint8_t scans_ = 0;  // in the mean colour, at most 8; 0: neither label nor colour
};

static_assert(sizeof(SemanticOcTreeNode) == sizeof(void*) + 16);

/// OctoMap tree whose voxels carry labels: a tree type of its own ("SemanticOcTree"), so labels survive
/// saving and nothing pretends to be another type. All of OctoMap's queries work; keys and log-odds are
/// OctoMap's.
///
/// Pruning merges eight equal log-odds only where the top label agrees, too. integrate() fuses a whole scan,
/// to the same occupancy as OctoMap's insertPointCloud, in the order of the octree.
class SemanticOcTree : public octomap::OccupancyOcTreeBase<SemanticOcTreeNode> {
  using Base = octomap::OccupancyOcTreeBase<SemanticOcTreeNode>;

 public:
  using Key = VoxelKey;
  using Scan = ScanVoxels;
  using Voxel = MapVoxel;
  using Node = SemanticOcTreeNode;

  /// @param edge  of a voxel [m]
  explicit SemanticOcTree(double edge) : Base(edge) { registration_.ensure_linking(); }
  SemanticOcTree(const SemanticOcTree& other) = default;
  SemanticOcTree& operator=(const SemanticOcTree&) = delete;

  SemanticOcTree* create() const override { return new SemanticOcTree(resolution); }
  std::string getTreeType() const override { return "SemanticOcTree"; }

  [[nodiscard]] VoxelGrid grid() const { return VoxelGrid(resolution); }

  /// Fuses a scan gathered on the same grid, after its finish(): each voxel once, Eq (12) with the tree's
  /// sensor model, clamped. Inner nodes are refreshed and pruned once, after all of their children. Change
  /// detection (OctoMap's) is not served.
  void integrate(const ScanVoxels& scan);

  /// State of the cell of 2^level voxels per edge that holds the key.
  [[nodiscard]] MapVoxel at(const VoxelKey& key, int level = 0) const {
    if (root == nullptr) return {};
    const Node* node = root;
    for (int i = int(tree_depth) - 1; i >= level; --i) {
      if (node->children == nullptr) break;  // a pruned cell
      node = child(node, octomap::computeChildIdx(octomap::OcTreeKey(key[0], key[1], key[2]), i));
      if (node == nullptr) return {};
    }
    return describe(*node);
  }
  [[nodiscard]] MapVoxel describe(const Node& node) const {
    return {node.value >= occ_prob_thres_log ? Occupancy::occupied : Occupancy::free, node.value,
            node.label(), static_cast<float>(node.labels().confidence())};
  }

  /// Calls f(key, MapVoxel) for each occupied cell of the level that touches the keys [low, high].
  template <class F>
  void for_each_occupied(const VoxelKey& low, const VoxelKey& high, int level, F&& f) const {
    if (root != nullptr) visit(root, int(tree_depth), {0, 0, 0}, low, high, level, f);
  }

  bool isNodeCollapsible(const Node* node) const override {
    if (node->children == nullptr) return false;
    const Node* first = child(node, 0);
    if (first == nullptr || first->children != nullptr) return false;
    for (unsigned i = 1; i < 8; ++i) {
      const Node* other = child(node, i);
      if (other == nullptr || other->children != nullptr || other->value != first->value ||
          other->labelled() != first->labelled() || other->label() != first->label())
        return false;
    }
    return true;
  }
  bool pruneNode(Node* node) override {
    if (!isNodeCollapsible(node)) return false;
    collapse(node);
    return true;
  }
  /// As OctoMap's; a voxel that becomes free forgets its label.
  void updateNodeLogOdds(Node* node, const float& update) const override {
    node->value = std::clamp(node->value + update, clamping_thres_min, clamping_thres_max);
    if (node->value < occ_prob_thres_log) node->forget_labels();
  }

  /// Reads nodes as writeData() wrote them. Sets failbit and leaves the tree empty when the data end early,
  /// are deeper than the tree, or hold impossible values; OctoMap's own reader would go on with garbage.
  std::istream& readData(std::istream& s) override {
    clear();
    size_changed = true;
    root = new Node();
    tree_size = 1;
    if (!read_node(root, 0, s)) {
      clear();
      s.setstate(std::ios::failbit);
    }
    return s;
  }

 private:
  static const Node* child(const Node* node, unsigned i) {
    return static_cast<const Node*>(node->children[i]);
  }
  static Node* child(Node* node, unsigned i) { return static_cast<Node*>(node->children[i]); }

  bool read_node(Node* node, unsigned depth, std::istream& s) {
    if (!node->readData(s)) return false;
    const int byte = s.get();
    if (byte == std::istream::traits_type::eof() || (byte != 0 && depth >= tree_depth)) return false;
    for (unsigned i = 0; i < 8; ++i) {
      if ((byte >> i & 1) != 0 && !read_node(createNodeChild(node, i), depth + 1, s)) return false;
    }
    return true;
  }

  void collapse(Node* node) {
    node->fuse_children(8);  // the mean of the votes: expanding again gives each child as many as it had
    for (unsigned i = 0; i < 8; ++i) deleteNodeChild(node, i);
    delete[] node->children;
    node->children = nullptr;
  }
  /// Node from its children, or without them where they are all alike.
  void refresh(Node* node) {
    if (isNodeCollapsible(node)) {
      collapse(node);
    } else {
      node->fuse_children(1);
    }
  }
  [[nodiscard]] bool saturated_free(const Node& node) const { return node.value <= clamping_thres_min; }

  bool miss(Node& node) const {
    if (saturated_free(node)) return false;
    updateNodeLogOdds(&node, prob_miss_log);
    return true;
  }
  void hit(Node& node, const VoxelEnd& end) const {
    updateNodeLogOdds(&node, end.weight * prob_hit_log);
    if (node.value >= occ_prob_thres_log) node.observe(end);
  }

  /// The part of a scan that lies in one cell.
  struct Part {
    const ScanVoxels& scan;
    const ScanBlock& block;
    std::size_t first;  ///< place of the cell's first voxel in the block
  };

  /// Fuses 8^level voxels into the node that is their cell. @return whether anything changed
  template <int level>
  bool update_cell(Node* node, bool created, const Part& part);
  template <int level, class Bits>
  static std::uint64_t bits_of(const Bits& bits, std::size_t first) {
    if constexpr (level == 2) {
      return bits[first >> 6];
    } else if constexpr (level == 1) {
      return bits[first >> 6] >> (first & 63) & 0xFF;
    } else {
      return bits[first >> 6] >> (first & 63) & 1;
    }
  }

  template <class F>
  void visit(const Node* node, int node_level, const std::array<int, 3>& corner, const VoxelKey& low,
             const VoxelKey& high, int level, F& f) const {
    const int edge = 1 << node_level;
    for (std::size_t a = 0; a < 3; ++a) {
      if (corner[a] > int(high[a]) || corner[a] + edge <= int(low[a])) return;
    }
    if (node->value < occ_prob_thres_log) return;  // the largest of the children: nothing in it is occupied
    if (node_level <= level) {
      f(VoxelKey{{static_cast<std::uint16_t>(corner[0]), static_cast<std::uint16_t>(corner[1]),
                  static_cast<std::uint16_t>(corner[2])}},
        describe(*node));
      return;
    }
    const int half = edge / 2;
    for (unsigned i = 0; i < 8; ++i) {
      // A pruned cell stands for all of its parts.
      const Node* next = node->children == nullptr ? node : child(node, i);
      if (next == nullptr) continue;
      visit(next, node_level - 1,
            {corner[0] + ((i & 1) != 0 ? half : 0), corner[1] + ((i & 2) != 0 ? half : 0),
             corner[2] + ((i & 4) != 0 ? half : 0)},
            low, high, level, f);
    }
  }

  /// Makes AbstractOcTree::read() and createTree() know the type, in every program that includes this header.
  struct Registration {
    Registration() {
      auto* prototype = new SemanticOcTree(0.1);
      prototype->clearKeyRays();
      octomap::AbstractOcTree::registerTreeType(prototype);
    }
    void ensure_linking() {}
  };
  inline static Registration registration_;
};

template <int level>
bool SemanticOcTree::update_cell(Node* node, bool created, const Part& part) {
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

inline void SemanticOcTree::integrate(const ScanVoxels& scan) {
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

inline std::ostream& SemanticOcTreeNode::writeData(std::ostream& s) const {
  // float log-odds; a bit per label that has votes; then, if there are any: these votes, colour, scans.
  s.write(reinterpret_cast<const char*>(&value), sizeof value);
  unsigned mask = 0;
  for (std::uint8_t l = 0; l < kMapLabels; ++l) mask |= labels_.votes(l) > 0 ? 1U << l : 0U;
  s.put(static_cast<char>(mask));
  if (mask == 0) return s;
  for (std::uint8_t l = 0; l < kMapLabels; ++l) {
    if (labels_.votes(l) > 0) s.put(static_cast<char>(labels_.votes(l)));
  }
  for (const std::uint8_t c : colour_) s.put(static_cast<char>(c));
  return s.put(static_cast<char>(scans_));
}

inline std::istream& SemanticOcTreeNode::readData(std::istream& s) {
  const auto byte = [&s] {
    const int b = s.get();
    return static_cast<std::uint8_t>(b < 0 ? 0 : b);
  };
  float log_odds = 0;
  if (!s.read(reinterpret_cast<char*>(&log_odds), sizeof log_odds)) return s;
  const std::uint8_t mask = byte();
  std::array<std::uint8_t, kMapLabels> votes{};
  Colour colour{};
  std::uint8_t scans = 0;
  if (mask != 0) {
    for (std::size_t l = 0; l < kMapLabels; ++l) {
      if ((mask >> l & 1) == 0) continue;
      votes[l] = byte();
      if (votes[l] == 0) s.setstate(std::ios::failbit);
    }
    for (auto& c : colour) c = byte();
    scans = byte();
    if (scans == 0 || scans > 8) s.setstate(std::ios::failbit);
  }
  if (!std::isfinite(log_odds)) s.setstate(std::ios::failbit);
  if (!s) return s;
  value = log_odds;
  labels_ = MapLabels(votes);
  colour_ = colour;
  scans_ = scans;
  return s;
}

static_assert(VoxelStore<SemanticOcTree>);

}  // namespace dynslam::interop
