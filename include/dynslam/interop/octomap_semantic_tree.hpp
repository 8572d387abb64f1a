// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <octomap/OccupancyOcTreeBase.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>

#include "dynslam/concepts/map.hpp"
#include "dynslam/interop/octomap_semantic_node.hpp"
#include "dynslam/semantic/map_voxel.hpp"
#include "dynslam/semantic/scan_voxels.hpp"
#include "dynslam/semantic/voxel_key.hpp"

namespace dynslam::interop {

/// OctoMap tree whose voxels carry labels: a tree type of its own (see getTreeType()), so labels survive
/// saving and nothing pretends to be another type. All of OctoMap's queries work; keys and log-odds are
/// OctoMap's.
///
/// Pruning merges eight equal log-odds only where the top label agrees, too. integrate() fuses a whole scan,
/// to the same occupancy as OctoMap's insertPointCloud, in the order of the octree.
/// @tparam N  number of labels, 1 to 255; a node has 16 bytes and one per label
template <std::size_t N>
class BasicSemanticOcTree : public octomap::OccupancyOcTreeBase<BasicSemanticOcTreeNode<N>> {
  using Base = octomap::OccupancyOcTreeBase<BasicSemanticOcTreeNode<N>>;

 public:
  using Base::createNodeChild;
  using Base::deleteNodeChild;
  using Base::expandNode;

  using Key = VoxelKey;
  using Scan = BasicScanVoxels<N>;
  using Voxel = MapVoxel;
  using Node = BasicSemanticOcTreeNode<N>;

  /// @param edge  of a voxel [m]
  explicit BasicSemanticOcTree(double edge) : Base(edge) { register_type(); }
  BasicSemanticOcTree(const BasicSemanticOcTree& other) = default;
  BasicSemanticOcTree& operator=(const BasicSemanticOcTree&) = delete;

  BasicSemanticOcTree* create() const override { return new BasicSemanticOcTree(this->resolution); }
  /// "SemanticOcTree", with other numbers of labels than kMapLabels followed by that number.
  std::string getTreeType() const override {
    return N == kMapLabels ? "SemanticOcTree" : "SemanticOcTree" + std::to_string(N);
  }

  /// Makes OctoMap's AbstractOcTree::read() and createTree() know the type; the first tree made does, too.
  static bool register_type() {
    static const bool registered = [] {
      auto* prototype = new BasicSemanticOcTree(0.1, Prototype{});
      prototype->clearKeyRays();
      octomap::AbstractOcTree::registerTreeType(prototype);
      return true;
    }();
    return registered;
  }

  [[nodiscard]] VoxelGrid grid() const { return VoxelGrid(this->resolution); }

  /// Fuses a scan gathered on the same grid, after its finish(): each voxel once, Eq (12) with the tree's
  /// sensor model, clamped. Inner nodes are refreshed and pruned once, after all of their children. Change
  /// detection (OctoMap's) is not served.
  void integrate(const Scan& scan);

  /// State of the cell of 2^level voxels per edge that holds the key.
  [[nodiscard]] MapVoxel at(const VoxelKey& key, int level = 0) const {
    const Node* node = find(key, level);
    return node == nullptr ? MapVoxel{} : describe(*node);
  }
  [[nodiscard]] MapVoxel describe(const Node& node) const {
    return {state(node), node.value, node.label(), static_cast<float>(node.labels().confidence())};
  }

  /// Asks for states alone: at(key, level).state, without a look at labels. See VoxelMap.
  class Reader {
   public:
    explicit Reader(const BasicSemanticOcTree& tree) : tree_(&tree) {}
    [[nodiscard]] Occupancy state(const VoxelKey& key, int level) const {
      const Node* node = tree_->find(key, level);
      return node == nullptr ? Occupancy::unknown : tree_->state(*node);
    }

   private:
    const BasicSemanticOcTree* tree_;
  };

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
  /// As OctoMap's; a voxel that becomes free forgets its label, and NaN changes nothing.
  void updateNodeLogOdds(Node* node, const float& update) const override {
    if (std::isnan(update)) return;
    node->value = std::clamp(node->value + update, clamping_thres_min, clamping_thres_max);
    if (node->value < occ_prob_thres_log) node->forget_labels();
  }

  /// Reads nodes as writeData() wrote them. Sets failbit and leaves the tree empty when the data end early,
  /// are deeper than the tree, or hold impossible values; OctoMap's own reader would go on with garbage.
  std::istream& readData(std::istream& s) override {
    this->clear();
    size_changed = true;
    root = new Node();
    tree_size = 1;
    if (!read_node(root, 0, s)) {
      this->clear();
      s.setstate(std::ios::failbit);
    }
    return s;
  }

 private:
  struct Prototype {};  // for the registration, which must not wait for itself
  BasicSemanticOcTree(double edge, Prototype) : Base(edge) {}

  using Base::clamping_thres_max;
  using Base::clamping_thres_min;
  using Base::occ_prob_thres_log;
  using Base::prob_hit_log;
  using Base::prob_miss_log;
  using Base::root;
  using Base::size_changed;
  using Base::tree_depth;
  using Base::tree_size;

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
  /// The node of the cell, or the pruned one above it; nullptr where nothing was observed.
  [[nodiscard]] const Node* find(const VoxelKey& key, int level) const {
    const Node* node = root;
    for (int i = int(tree_depth) - 1; i >= level && node != nullptr && node->children != nullptr; --i)
      node = child(node, octomap::computeChildIdx(octomap::OcTreeKey(key[0], key[1], key[2]), i));
    return node;
  }
  [[nodiscard]] Occupancy state(const Node& node) const {
    return node.value >= occ_prob_thres_log ? Occupancy::occupied : Occupancy::free;
  }
  [[nodiscard]] bool saturated_free(const Node& node) const { return node.value <= clamping_thres_min; }

  bool miss(Node& node) const {
    if (saturated_free(node)) return false;
    updateNodeLogOdds(&node, prob_miss_log);
    return true;
  }
  void hit(Node& node, const BasicVoxelEnd<N>& end) const {
    updateNodeLogOdds(&node, end.weight * prob_hit_log);
    if (node.value >= occ_prob_thres_log) node.observe(end);
  }

  /// The part of a scan that lies in one cell.
  struct Part {
    const Scan& scan;
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
};

/// The tree of this library's own maps.
using SemanticOcTree = BasicSemanticOcTree<kMapLabels>;

/// In every program that includes this header OctoMap's readers know the type. Trees of other numbers of
/// labels are known from the first one made.
inline const bool kSemanticOcTreeRegistered = SemanticOcTree::register_type();

}  // namespace dynslam::interop

#include "dynslam/interop/octomap_semantic_fusion.hpp"

namespace dynslam::interop {
static_assert(VoxelStore<SemanticOcTree> && VoxelStore<BasicSemanticOcTree<80>>);
}  // namespace dynslam::interop

#include "dynslam/pop_macros.hpp"
