// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "dynslam/concepts/image.hpp"
#include "dynslam/config.hpp"
#include "dynslam/image/image_row.hpp"
#include "dynslam/segment/connectivity.hpp"
#include "dynslam/segment/pixel_runs.hpp"

namespace dynslam {

/// Memory of connected_components(); keep it between calls to avoid allocation.
struct ComponentsWorkspace {
  std::vector<std::uint64_t> bits;  ///< of one row
  std::vector<PixelRun> runs;       ///< row by row
  std::vector<int> parent;          ///< of each run, an earlier run of its component; of the first, itself
  std::vector<int> number;          ///< of each run's component, from 1 on
};

namespace detail {
/// First run of a component; halves the path on the way.
inline int component_root(std::vector<int>& parent, int i) {
  while (parent[static_cast<std::size_t>(i)] != i) {
    auto& p = parent[static_cast<std::size_t>(i)];
    p = parent[static_cast<std::size_t>(p)];
    i = p;
  }
  return i;
}

/// Appends the runs of a row and makes each one with those that it touches in the row above.
/// @param above  where the runs of the row above begin; they end where those of this row begin
template <int reach>
void join_row(const std::uint64_t* bits, int v, int w, std::size_t above, ComponentsWorkspace& ws) {
  const std::size_t end_above = ws.runs.size();
  for_runs(bits, w, [&](int begin, int end) {
    int root = static_cast<int>(ws.runs.size());
    ws.parent.push_back(root);
    ws.runs.push_back({v, begin, end});
    while (above < end_above && ws.runs[above].end + reach <= begin) ++above;
    for (std::size_t k = above; k < end_above && ws.runs[k].begin < end + reach; ++k) {
      const int other = component_root(ws.parent, static_cast<int>(k));
      ws.parent[static_cast<std::size_t>(std::max(root, other))] = std::min(root, other);
      root = std::min(root, other);
    }
  });
}

/// Runs of the pixels of a mask that are nonzero, or of those that are zero, and the number of each one's
/// component, 1 ... n in order of the first pixel row by row. @return n
template <class Mask>
int number_runs(const Mask& mask, bool zeros, Connectivity connectivity, ComponentsWorkspace& ws) {
  const int w = mask.width(), h = mask.height();
  const std::size_t words = words_of_row(w);
  ws.bits.resize(words);
  ws.runs.clear();
  ws.parent.clear();
  std::size_t above = 0;
  for (int v = 0; v < h; ++v) {
    row_to_bits(image_row(mask, v), w, ws.bits.data());
    if (zeros) {
      for (std::uint64_t& word : ws.bits) word = ~word;
      if (w > 0) ws.bits.back() &= last_word(w);
    }
    const std::size_t begin = ws.runs.size();
    if (connectivity == Connectivity::eight) {
      join_row<1>(ws.bits.data(), v, w, above, ws);
    } else {
      join_row<0>(ws.bits.data(), v, w, above, ws);
    }
    above = begin;
  }
  ws.number.resize(ws.runs.size());
  int n = 0;
  for (std::size_t i = 0; i < ws.runs.size(); ++i) {  // a parent stands before its children
    const auto parent = static_cast<std::size_t>(ws.parent[i]);
    ws.number[i] = parent == i ? ++n : ws.number[parent];
  }
  return n;
}

/// Pixels of each of n components that number_runs() found; counts[0] is 0.
inline void count_pixels(const ComponentsWorkspace& ws, int n, std::vector<int>& counts) {
  counts.assign(static_cast<std::size_t>(n) + 1, 0);
  for (std::size_t i = 0; i < ws.runs.size(); ++i)
    counts[static_cast<std::size_t>(ws.number[i])] += ws.runs[i].end - ws.runs[i].begin;
}
}  // namespace detail

/// Connected components of the nonzero pixels without an image of labels, for what needs areas or boxes
/// alone: run i of `workspace.runs` is part of component `workspace.number[i]`, 1 ... n in order of first
/// pixels row by row.
/// @param counts  out: `counts[component]` = pixels (counts[0] unused)
/// @return n
template <LabelImage Mask>
int component_runs(const Mask& mask, Connectivity connectivity, std::vector<int>& counts,
                   ComponentsWorkspace& workspace) {
  const int n = detail::number_runs(mask, false, connectivity, workspace);
  detail::count_pixels(workspace, n, counts);
  return n;
}

/// Connected components of the nonzero pixels: runs of each row, joined with those above by a union-find.
/// @param labels  out: 1 ... n in order of each component's first pixel row by row, 0 where the mask is zero;
/// an
///                image of 32-bit or wider integers, resized where it can be, of the mask's size otherwise
/// @param counts  out: `counts[label]` = pixels (counts[0] unused)
/// @return n
template <LabelImage Mask, OutputLabelImage Labels>
  requires(sizeof(typename std::remove_reference_t<Labels>::Pixel) >= sizeof(int))
int connected_components(const Mask& mask, Connectivity connectivity, Labels&& labels,
                         std::vector<int>& counts, ComponentsWorkspace& workspace) {
  using Label = typename std::remove_reference_t<Labels>::Pixel;
  if constexpr (requires { labels.resize(mask.width(), mask.height()); })
    labels.resize(mask.width(), mask.height());
  DYNSLAM_ASSERT(same_size(mask, labels), "labels and mask need the same size");
  const int n = component_runs(mask, connectivity, counts, workspace);
  for (int v = 0; v < labels.height(); ++v) detail::fill_run(labels, {v, 0, labels.width()}, Label(0));
  for (std::size_t i = 0; i < workspace.runs.size(); ++i)
    detail::fill_run(labels, workspace.runs[i], static_cast<Label>(workspace.number[i]));
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

#include "dynslam/pop_macros.hpp"
