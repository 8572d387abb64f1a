// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstddef>
#include <string>

namespace dynslam::test {

/// What two occupancy trees of any types have in common, node by node, inner nodes too.
struct TreeComparison {
  std::size_t nodes = 0;          ///< compared, pruned cells expanded where the other tree has parts
  std::size_t pruned_in_one = 0;  ///< nodes that stand for parts in the other tree
  double largest_difference = 0;  ///< of the log-odds
  std::string first_fault;        ///< empty: the same space is known in both
};

template <class A, class B>
class TreeComparer {
 public:
  TreeComparer(const A& a, const B& b) : a_(a), b_(b) {}
  TreeComparison compare() {
    if ((a_.getRoot() == nullptr) != (b_.getRoot() == nullptr)) {
      result_.first_fault = "one tree is empty";
    } else if (a_.getRoot() != nullptr) {
      descend(a_.getRoot(), b_.getRoot(), "root");
    }
    return result_;
  }

 private:
  template <class NodeA, class NodeB>
  void descend(const NodeA* a, const NodeB* b, const std::string& path) {
    ++result_.nodes;
    const double difference =
        std::abs(static_cast<double>(a->getLogOdds()) - static_cast<double>(b->getLogOdds()));
    result_.largest_difference = std::max(result_.largest_difference, difference);
    const bool parts_a = a_.nodeHasChildren(a), parts_b = b_.nodeHasChildren(b);
    if (!parts_a && !parts_b) return;
    if (parts_a != parts_b) ++result_.pruned_in_one;
    for (unsigned i = 0; i < 8; ++i) {
      const bool has_a = !parts_a || a_.nodeChildExists(a, i), has_b = !parts_b || b_.nodeChildExists(b, i);
      const std::string below = path + static_cast<char>('0' + i);
      if (has_a != has_b) {
        if (result_.first_fault.empty()) result_.first_fault = "known in one tree only: " + below;
        continue;
      }
      if (has_a) descend(parts_a ? a_.getNodeChild(a, i) : a, parts_b ? b_.getNodeChild(b, i) : b, below);
    }
  }

  const A& a_;
  const B& b_;
  TreeComparison result_;
};

/// Compares two trees by walking both at once.
template <class A, class B>
TreeComparison compare_trees(const A& a, const B& b) {
  return TreeComparer<A, B>(a, b).compare();
}

}  // namespace dynslam::test
