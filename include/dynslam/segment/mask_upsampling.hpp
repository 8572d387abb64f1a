// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "dynslam/concepts/image.hpp"
#include "dynslam/config.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/image/image_row.hpp"
#include "dynslam/image/image_view.hpp"

namespace dynslam {

/// Knows the cell of each pixel, j * width() + i or -1, and the range of cell rows that a row of pixels
/// meets.
template <class G>
concept PixelGrid = requires(const G& grid, int i) {
  { grid.width() } -> std::convertible_to<int>;
  { grid.height() } -> std::convertible_to<int>;
  { grid.cell(i, i) } -> std::convertible_to<int>;
  { grid.rows(i).begin } -> std::convertible_to<int>;
  { grid.rows(i).end } -> std::convertible_to<int>;
};

namespace detail {
enum class Zone : std::uint8_t { outside, rim, inside };

/// Where pixels must be looked at one by one: in the cells at the rim of a region.
template <LabelImage Cells>
void find_zones(const Cells& cells, ImageView<std::uint8_t> zone) {
  const int w = cells.width(), h = cells.height();
  for (int j = 0; j < h; ++j) {
    for (int i = 0; i < w; ++i) {
      bool any = false, all = true;
      for (int y = std::max(0, j - 1); y <= std::min(h - 1, j + 1); ++y) {
        for (int x = std::max(0, i - 1); x <= std::min(w - 1, i + 1); ++x) {
          const bool on = cells(x, y) != 0;
          any = any || on;
          all = all && on;
        }
      }
      zone(i, j) = static_cast<std::uint8_t>(all ? Zone::inside : any ? Zone::rim : Zone::outside);
    }
  }
}

/// Whether a mask shows anything.
template <LabelImage Mask>
[[nodiscard]] bool shows_anything(const Mask& mask) {
  bool any = false;
  for (int v = 0; v < mask.height(); ++v) {
    const auto row = image_row(mask, v);
    for (int u = 0; u < mask.width(); ++u) any |= row[u] != 0;  // without a branch: several at once
  }
  return any;
}

/// Whether a pixel of depth z in cell (i, j) belongs to the mask: as the neighbouring cell whose depth is
/// most like its own; without depth as most of them.
template <LabelImage Cells, DepthImage D>
[[nodiscard]] bool follows_mask(const Cells& cells, const D& cell_depth, int i, int j, float z) {
  int on = 0, total = 0;
  float best = std::numeric_limits<float>::max();
  bool verdict = false;
  for (int y = std::max(0, j - 1); y <= std::min(cells.height() - 1, j + 1); ++y) {
    for (int x = std::max(0, i - 1); x <= std::min(cells.width() - 1, i + 1); ++x) {
      const bool cell = cells(x, y) != 0;
      ++total;
      on += cell ? 1 : 0;
      const float difference = std::abs(static_cast<float>(cell_depth(x, y)) - z);
      if (difference < best) {
        best = difference;
        verdict = cell;
      }
    }
  }
  return is_valid_depth(z) ? verdict : 2 * on >= total;
}
}  // namespace detail

/// Enlarges a mask of cells to pixels. Each pixel at the rim of a region follows the neighbouring cell whose
/// depth is most like its own, which restores the object's outline at full resolution.
/// @param cells       nonzero where the mask is
/// @param cell_depth  of the same size [m]
/// @param depth       of the pixels [m]
/// @param mask        out: 255 or 0; the size of `depth`
/// @param zone        memory, kept between calls
template <LabelImage Cells, DepthImage C, DepthImage D, PixelGrid G, OutputLabelImage Mask>
void upsample_mask(const Cells& cells, const C& cell_depth, const D& depth, const G& grid, Mask&& mask,
                   Image<std::uint8_t>& zone) {
  const int w = cells.width(), h = cells.height();
  DYNSLAM_ASSERT(
      w == grid.width() && h == grid.height() && w == cell_depth.width() && h == cell_depth.height(),
      "cells and their depth have the grid's size");
  DYNSLAM_ASSERT(same_size(mask, depth), "the mask has the size of the depth image");
  const bool any = detail::shows_anything(cells);  // mostly nothing moves
  if (any) {
    zone.resize(w, h);
    detail::find_zones(cells, zone.view());
  }
  constexpr auto kOutside = static_cast<std::uint8_t>(detail::Zone::outside);
  constexpr auto kInside = static_cast<std::uint8_t>(detail::Zone::inside);
  const std::uint8_t* zones = zone.data();
  for (int v = 0; v < depth.height(); ++v) {
    auto out = image_row(mask, v);
    for (int u = 0; u < mask.width(); ++u) out[u] = 0;
    if (!any) continue;
    const auto rows = grid.rows(v);
    if (std::all_of(zones + rows.begin * w, zones + rows.end * w,
                    [](std::uint8_t z) { return z == kOutside; }))
      continue;
    for (int u = 0; u < depth.width(); ++u) {
      const int c = grid.cell(u, v);
      if (c < 0 || zones[c] == kOutside) continue;
      if (zones[c] == kInside ||
          detail::follows_mask(cells, cell_depth, c % w, c / w, static_cast<float>(depth(u, v))))
        out[u] = static_cast<typename std::remove_reference_t<Mask>::Pixel>(255);
    }
  }
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
