// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>
#include <vector>

#include "dynslam/concepts/image.hpp"
#include "dynslam/config.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/image/image_row.hpp"
#include "dynslam/segment/connected_components.hpp"
#include "dynslam/segment/connectivity.hpp"

// Masks are images of integers, nonzero = set; what these functions set is 255 (as far as the pixel's type
// goes: true for bool). Images of one call need the same size (asserted); images without pixels are fine.

namespace dynslam {

/// Memory of the mask operations; keep it between calls to avoid allocation.
struct MaskWorkspace {
  Image<std::uint8_t> rows, next_rows;
  std::vector<std::uint8_t> line, next_line;
  ComponentsWorkspace components;
  Image<int> labels;
  std::vector<int> counts;
};

namespace detail {
template <class I>
inline constexpr auto kMaskSet = static_cast<typename std::remove_cvref_t<I>::Pixel>(255);

/// to[i] = from[i] | from[i + shift], n bytes; compilers make it one of vectors where the two are apart.
inline void or_shifted(const std::uint8_t* from, std::size_t shift, std::uint8_t* to, std::size_t n) {
  const std::uint8_t* other = from + shift;
  for (std::size_t i = 0; i < n; ++i) to[i] = static_cast<std::uint8_t>(from[i] | other[i]);
}

/// Calls step(shift) such that, started with single elements and each time or-ed with those `shift` further
/// on, an element holds the or of `window`.
template <class Step>
void widen_window(int window, Step&& step) {
  for (int have = 1; have < window;) {
    const int shift = std::min(have, window - have);
    step(shift);
    have += shift;
  }
}

/// Square structuring element, separated into rows and columns; windows grow by doubling, so the work is that
/// of the logarithm of the radius. Erosion is the dilation of what is not set.
template <class In, class Out>
void morphology(const In& in, Out& out, int radius, bool grow, MaskWorkspace& workspace) {
  DYNSLAM_ASSERT(same_size(in, out) && radius >= 0, "equal sizes, radius >= 0");
  const int w = in.width(), h = in.height();
  if (w == 0 || h == 0) return;
  radius = std::min(radius, std::max(w, h));  // no more is needed, and sums with it cannot overflow
  const auto width = static_cast<std::size_t>(w), rim = static_cast<std::size_t>(radius);
  auto& line = workspace.line;
  auto& next = workspace.next_line;
  line.assign(width + 2 * rim, 0);
  next.assign(width + 2 * rim, 0);
  Image<std::uint8_t>* rows = &workspace.rows;
  Image<std::uint8_t>* next_rows = &workspace.next_rows;
  rows->resize(w, h + 2 * radius);
  next_rows->resize(w, h + 2 * radius);
  const std::uint8_t flip = grow ? 0 : 1;
  for (int v = 0; v < h; ++v) {
    const auto from = image_row(in, v);
    std::fill_n(line.begin(), rim, std::uint8_t{0});
    std::fill(line.end() - static_cast<std::ptrdiff_t>(rim), line.end(), std::uint8_t{0});
    std::uint8_t* set = line.data() + rim;
    for (int u = 0; u < w; ++u) set[u] = static_cast<std::uint8_t>((from[u] != 0 ? 1 : 0) ^ flip);
    std::size_t n = line.size();
    widen_window(2 * radius + 1, [&](int shift) {
      n -= static_cast<std::size_t>(shift);
      or_shifted(line.data(), static_cast<std::size_t>(shift), next.data(), n);
      line.swap(next);
    });
    std::copy_n(line.begin(), w, rows->row(radius + v));
  }
  for (int v = 0; v < radius; ++v) {
    std::fill_n(rows->row(v), w, std::uint8_t{0});
    std::fill_n(rows->row(h + radius + v), w, std::uint8_t{0});
  }
  std::size_t n = static_cast<std::size_t>(h + 2 * radius) * width;
  widen_window(2 * radius + 1, [&](int shift) {
    n -= static_cast<std::size_t>(shift) * width;
    or_shifted(rows->data(), static_cast<std::size_t>(shift) * width, next_rows->data(), n);
    std::swap(rows, next_rows);
  });
  for (int v = 0; v < h; ++v) {
    const std::uint8_t* from = rows->row(v);
    auto to = image_row(out, v);
    for (int u = 0; u < w; ++u) to[u] = from[u] != flip ? kMaskSet<Out> : typename Out::Pixel(0);
  }
}
}  // namespace detail

/// Dilation by a square of half side `radius` [pixels]. `in` and `out` may be the same image.
template <LabelImage In, OutputLabelImage Out>
void dilate(const In& in, Out&& out, int radius, MaskWorkspace& workspace) {
  detail::morphology(in, out, radius, true, workspace);
}
/// The same with memory of its own.
template <LabelImage In, OutputLabelImage Out>
void dilate(const In& in, Out&& out, int radius) {
  MaskWorkspace workspace;
  dilate(in, out, radius, workspace);
}

/// Erosion by a square of half side `radius` [pixels]; pixels outside the image do not erode. `in` and `out`
/// may be the same image.
template <LabelImage In, OutputLabelImage Out>
void erode(const In& in, Out&& out, int radius, MaskWorkspace& workspace) {
  detail::morphology(in, out, radius, false, workspace);
}
/// The same with memory of its own.
template <LabelImage In, OutputLabelImage Out>
void erode(const In& in, Out&& out, int radius) {
  MaskWorkspace workspace;
  erode(in, out, radius, workspace);
}

/// 8-connected components of a mask, see connected_components.hpp.
template <LabelImage Mask, OutputLabelImage Labels>
int connected_components(const Mask& mask, Labels&& labels, std::vector<int>& counts,
                         MaskWorkspace& workspace) {
  return connected_components(mask, Connectivity::eight, labels, counts, workspace.components);
}

/// Clears the 8-connected components with fewer than `min_pixels` pixels.
template <OutputLabelImage Mask>
void remove_small(Mask&& mask, int min_pixels, MaskWorkspace& workspace) {
  connected_components(mask, Connectivity::eight, workspace.labels, workspace.counts, workspace.components);
  for (int v = 0; v < mask.height(); ++v) {
    auto row = image_row(mask, v);
    const int* label = workspace.labels.row(v);
    for (int u = 0; u < mask.width(); ++u) {
      if (label[u] != 0 && workspace.counts[static_cast<std::size_t>(label[u])] < min_pixels) row[u] = 0;
    }
  }
}
/// The same with memory of its own.
template <OutputLabelImage Mask>
void remove_small(Mask&& mask, int min_pixels) {
  MaskWorkspace workspace;
  remove_small(mask, min_pixels, workspace);
}

/// Sets the holes: components of zero pixels that do not touch the border of the image and have at most
/// `max_pixels` pixels.
/// @param holes  which zero pixels are one hole. Four, the complement of an 8-connected foreground: a closed
/// curve
///               of diagonal steps has an inside. Eight is cautious: what touches the outside, or a large
///               hole, at a corner stays open.
template <OutputLabelImage Mask>
void fill_holes(Mask&& mask, int max_pixels, Connectivity holes, MaskWorkspace& workspace) {
  const int w = mask.width(), h = mask.height();
  if (w == 0 || h == 0) return;
  workspace.rows.resize(w, h);
  for (int v = 0; v < h; ++v) {
    const auto row = image_row(mask, v);
    std::uint8_t* to = workspace.rows.row(v);
    for (int u = 0; u < w; ++u) to[u] = row[u] == 0 ? 1 : 0;
  }
  connected_components(workspace.rows, holes, workspace.labels, workspace.counts, workspace.components);
  constexpr int kOpen = -1;  // in place of the count of a component that touches the border
  const auto open = [&](int u, int v) {
    workspace.counts[static_cast<std::size_t>(workspace.labels(u, v))] = kOpen;
  };
  for (int u = 0; u < w; ++u) {
    open(u, 0);
    open(u, h - 1);
  }
  for (int v = 0; v < h; ++v) {
    open(0, v);
    open(w - 1, v);
  }
  for (int v = 0; v < h; ++v) {
    auto row = image_row(mask, v);
    const int* label = workspace.labels.row(v);
    for (int u = 0; u < w; ++u) {
      if (label[u] == 0) continue;
      const int count = workspace.counts[static_cast<std::size_t>(label[u])];
      if (count != kOpen && count <= max_pixels) row[u] = detail::kMaskSet<Mask>;
    }
  }
}
/// The same for holes that are connected by sides.
template <OutputLabelImage Mask>
void fill_holes(Mask&& mask, int max_pixels, MaskWorkspace& workspace) {
  fill_holes(mask, max_pixels, Connectivity::four, workspace);
}
/// The same for holes that are connected by sides, with memory of its own.
template <OutputLabelImage Mask>
void fill_holes(Mask&& mask, int max_pixels) {
  MaskWorkspace workspace;
  fill_holes(mask, max_pixels, Connectivity::four, workspace);
}

}  // namespace dynslam
