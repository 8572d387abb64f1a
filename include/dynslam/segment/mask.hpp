// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

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
#include "dynslam/segment/pixel_runs.hpp"

// Masks are images of integers, nonzero = set; what these functions set is 255 (as far as the pixel's type
// goes: true for bool). Images of one call need the same size (asserted); images without pixels are fine.

namespace dynslam {

/// Memory of the mask operations; keep it between calls to avoid allocation.
struct MaskWorkspace {
  std::vector<std::uint64_t> line, rows, next_rows;  ///< a bit per pixel
  ComponentsWorkspace components;
  std::vector<int> counts;
};

namespace detail {
template <class I>
inline constexpr auto kMaskSet = static_cast<typename std::remove_cvref_t<I>::Pixel>(255);

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

/// bits[i] |= bits[i + shift] in n words, in place; bits beyond them, of which as many are read, are 0.
inline void or_bits(std::uint64_t* row, std::size_t n, int shift) {
  const std::size_t words = static_cast<std::size_t>(shift) / kWordPixels;
  const int part = shift % kWordPixels;
  if (words == 0) {  // by 1 to 63; of a distance that compilers know
    for (std::size_t k = 0; k < n; ++k) row[k] |= row[k] >> part | row[k + 1] << (kWordPixels - part);
  } else {
    for (std::size_t k = 0; k < n; ++k)
      row[k] |= row[k + words] >> part | (part == 0 ? 0 : row[k + words + 1] << (kWordPixels - part));
  }
}

/// to = the n words of a row, moved up by `shift`.
inline void move_bits(const std::uint64_t* row, std::size_t n, int shift, std::vector<std::uint64_t>& to) {
  const std::size_t words = static_cast<std::size_t>(shift) / kWordPixels;
  const int part = shift % kWordPixels;
  std::fill(to.begin(), to.end(), std::uint64_t{0});
  for (std::size_t k = 0; k < n; ++k) {
    to[k + words] |= row[k] << part;
    if (part != 0 && k + words + 1 < to.size()) to[k + words + 1] |= row[k] >> (kWordPixels - part);
  }
}

/// to[i] = from[i] | from[i + shift], n words; compilers make it one of vectors where the two are apart.
inline void or_shifted(const std::uint64_t* from, std::size_t shift, std::uint64_t* to, std::size_t n) {
  const std::uint64_t* other = from + shift;
  for (std::size_t i = 0; i < n; ++i) to[i] = from[i] | other[i];
}

/// Square structuring element, separated into rows and columns, with a bit per pixel; windows grow by
/// doubling, so the work is that of the logarithm of the radius. Erosion is the dilation of what is not set.
template <class In, class Out>
void morphology(const In& in, Out& out, int radius, bool grow, MaskWorkspace& workspace) {
  DYNSLAM_ASSERT(same_size(in, out) && radius >= 0, "equal sizes, radius >= 0");
  const int w = in.width(), h = in.height();
  if (w == 0 || h == 0) return;
  radius = std::min(radius, std::max(w, h));  // no more is needed, and sums with it cannot overflow
  const std::size_t words = words_of_row(w), rim = static_cast<std::size_t>(radius) * words;
  const std::uint64_t flip = grow ? 0 : ~std::uint64_t{0};
  auto& rows = workspace.rows;
  rows.assign(static_cast<std::size_t>(h) * words + 2 * rim, 0);
  workspace.next_rows.resize(rows.size());
  const std::size_t padded = words_of_row(w + 2 * radius);
  workspace.line.resize(2 * padded + 1);
  for (int v = 0; v < h; ++v) {
    std::uint64_t* row = rows.data() + rim + static_cast<std::size_t>(v) * words;
    row_to_bits(image_row(in, v), w, row);
    for (std::size_t k = 0; k < words; ++k) row[k] ^= flip;
    row[words - 1] &= last_word(w);
    if (std::all_of(row, row + words, [](std::uint64_t word) { return word == 0; })) continue;
    move_bits(row, words, radius, workspace.line);
    widen_window(2 * radius + 1, [&](int shift) { or_bits(workspace.line.data(), padded, shift); });
    std::copy_n(workspace.line.begin(), words, row);
  }
  std::size_t n = rows.size();
  widen_window(2 * radius + 1, [&](int shift) {
    n -= static_cast<std::size_t>(shift) * words;
    or_shifted(rows.data(), static_cast<std::size_t>(shift) * words, workspace.next_rows.data(), n);
    std::swap(rows, workspace.next_rows);
  });
  for (int v = 0; v < h; ++v) {
    std::uint64_t* row = rows.data() + static_cast<std::size_t>(v) * words;
    for (std::size_t k = 0; k < words; ++k) row[k] ^= flip;
    bits_to_row(row, w, kMaskSet<Out>, image_row(out, v));
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
  const ComponentsWorkspace& found = workspace.components;
  const int n = detail::number_runs(mask, false, Connectivity::eight, workspace.components);
  detail::count_pixels(found, n, workspace.counts);
  for (std::size_t i = 0; i < found.runs.size(); ++i) {
    if (workspace.counts[static_cast<std::size_t>(found.number[i])] < min_pixels)
      detail::fill_run(mask, found.runs[i], typename std::remove_reference_t<Mask>::Pixel(0));
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
  const ComponentsWorkspace& found = workspace.components;
  const int n = detail::number_runs(mask, true, holes, workspace.components);
  detail::count_pixels(found, n, workspace.counts);
  constexpr int kOpen = -1;  // in place of the count of a component that touches the border
  for (std::size_t i = 0; i < found.runs.size(); ++i) {
    const PixelRun& run = found.runs[i];
    if (run.begin == 0 || run.end == mask.width() || run.v == 0 || run.v == mask.height() - 1)
      workspace.counts[static_cast<std::size_t>(found.number[i])] = kOpen;
  }
  for (std::size_t i = 0; i < found.runs.size(); ++i) {
    const int count = workspace.counts[static_cast<std::size_t>(found.number[i])];
    if (count != kOpen && count <= max_pixels) detail::fill_run(mask, found.runs[i], detail::kMaskSet<Mask>);
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

#include "dynslam/pop_macros.hpp"
