// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "dynslam/concepts/image.hpp"
#include "dynslam/config.hpp"
#include "dynslam/image/image_row.hpp"
#include "dynslam/segment/connectivity.hpp"

namespace dynslam {

/// Memory of connected_components(); keep it between calls to avoid allocation.
struct ComponentsWorkspace {
  std::vector<int> parent;  ///< of each provisional label; a root is its own
  std::vector<int> number;  ///< final label of each root
};

namespace detail {
/// Root of a provisional label; halves the path on the way.
inline int component_root(std::vector<int>& parent, int i) {
  while (parent[static_cast<std::size_t>(i)] != i) {
    auto& p = parent[static_cast<std::size_t>(i)];
    p = parent[static_cast<std::size_t>(p)];
    i = p;
  }
  return i;
}

/// First pass: provisional labels from the neighbours that were visited before, and which of them are one.
template <class Mask, class Labels>
void label_provisionally(const Mask& mask, Connectivity connectivity, Labels& labels,
                         std::vector<int>& parent) {
  const int w = mask.width(), h = mask.height();
  const bool diagonal = connectivity == Connectivity::eight;
  for (int v = 0; v < h; ++v) {
    const auto set = image_row(mask, v);
    for (int u = 0; u < w; ++u) {
      int label = 0;
      if (set[u] != 0) {
        const auto join = [&](int x, int y) {
          if (x < 0 || y < 0 || x >= w) return;
          const auto other = static_cast<int>(labels(x, y));
          if (other == 0) return;
          const int root = component_root(parent, other);
          if (label == 0) {
            label = root;
          } else if (root != label) {  // the smaller label stays the root
            parent[static_cast<std::size_t>(std::max(root, label))] = std::min(root, label);
            label = std::min(root, label);
          }
        };
        join(u - 1, v);
        if (diagonal) join(u - 1, v - 1);
        join(u, v - 1);
        if (diagonal) join(u + 1, v - 1);
        if (label == 0) {
          label = static_cast<int>(parent.size());
          parent.push_back(label);
        }
      }
      labels(u, v) = label;
    }
  }
}
}  // namespace detail

/// Connected components of the nonzero pixels by two passes and a union-find.
/// @param labels  out: 1 ... n in order of each component's first pixel row by row, 0 where the mask is zero;
/// an
///                image of 32-bit or wider integers, resized where it can be, of the mask's size otherwise
/// @param counts  out: `counts[label]` = pixels (counts[0] unused)
/// @return n
template <LabelImage Mask, OutputLabelImage Labels>
  requires(sizeof(typename std::remove_reference_t<Labels>::Pixel) >= sizeof(int))
int connected_components(const Mask& mask, Connectivity connectivity, Labels&& labels,
                         std::vector<int>& counts, ComponentsWorkspace& workspace) {
  if constexpr (requires { labels.resize(mask.width(), mask.height()); })
    labels.resize(mask.width(), mask.height());
  DYNSLAM_ASSERT(same_size(mask, labels), "labels and mask need the same size");
  std::vector<int>& parent = workspace.parent;
  parent.assign(1, 0);
  detail::label_provisionally(mask, connectivity, labels, parent);
  workspace.number.assign(parent.size(), 0);
  int n = 0;
  for (int i = 1; i < static_cast<int>(parent.size()); ++i) {
    if (detail::component_root(parent, i) == i) workspace.number[static_cast<std::size_t>(i)] = ++n;
  }
  counts.assign(static_cast<std::size_t>(n) + 1, 0);
  for (int v = 0; v < mask.height(); ++v) {
    auto row = image_row(labels, v);
    for (int u = 0; u < mask.width(); ++u) {
      const auto provisional = static_cast<int>(row[u]);
      if (provisional == 0) continue;
      const int root = detail::component_root(parent, provisional);
      const int label = workspace.number[static_cast<std::size_t>(root)];
      row[u] = label;
      ++counts[static_cast<std::size_t>(label)];
    }
  }
  return n;
}
/// The same with memory of its own.
template <LabelImage Mask, OutputLabelImage Labels>
int connected_components(const Mask& mask, Connectivity connectivity, Labels&& labels,
                         std::vector<int>& counts) {
  ComponentsWorkspace workspace;
  return connected_components(mask, connectivity, labels, counts, workspace);
}

}  // namespace dynslam
