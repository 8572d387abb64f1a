// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "dynslam/config.hpp"
#include "dynslam/image/image.hpp"

namespace dynslam {

/// Memory of the mask operations; keep it between calls to avoid allocation.
struct MaskWorkspace {
  Image<std::uint8_t> rows;
  std::vector<int> parent, size;
  Image<int> labels;
  std::vector<int> counts;
};

namespace detail {
/// Separable square structuring element by running counts: constant work per pixel for any radius.
/// `grow`: any pixel set; else: all pixels (inside the image) set.
inline void morphology(ImageView<const std::uint8_t> in, ImageView<std::uint8_t> out, int radius, bool grow,
                       MaskWorkspace& ws) {
  DYNSLAM_ASSERT(in.width() == out.width() && in.height() == out.height() && radius >= 0,
                 "equal sizes, radius >= 0");
  const int w = in.width(), h = in.height();
  ws.rows.resize(w, h);
  const auto pass = [&](int n, auto&& get, auto&& set) {
    int count = 0, inside = 0;
    for (int i = 0; i < std::min(radius, n); ++i) {
      count += get(i);
      ++inside;
    }
    for (int i = 0; i < n; ++i) {
      if (i + radius < n) {
        count += get(i + radius);
        ++inside;
      }
      set(i, grow ? count > 0 : count == inside);
      if (i - radius >= 0) {
        count -= get(i - radius);
        --inside;
      }
    }
  };
  for (int v = 0; v < h; ++v) {
    const std::uint8_t* from = in.row(v);
    std::uint8_t* to = ws.rows.row(v);
    pass(
        w, [&](int u) { return from[u] != 0 ? 1 : 0; }, [&](int u, bool value) { to[u] = value ? 1 : 0; });
  }
  for (int u = 0; u < w; ++u) {
    pass(
        h, [&](int v) { return static_cast<int>(ws.rows(u, v)); },
        [&](int v, bool value) { out(u, v) = value ? std::uint8_t{255} : std::uint8_t{0}; });
  }
}
}  // namespace detail

/// Dilation by a square of half side `radius`; out is 0 or 255. `in` and `out` may be the same image.
inline void dilate(ImageView<const std::uint8_t> in, ImageView<std::uint8_t> out, int radius,
                   MaskWorkspace& ws) {
  detail::morphology(in, out, radius, true, ws);
}

/// Erosion by a square of half side `radius`; pixels outside the image do not erode. Out is 0 or 255.
inline void erode(ImageView<const std::uint8_t> in, ImageView<std::uint8_t> out, int radius,
                  MaskWorkspace& ws) {
  detail::morphology(in, out, radius, false, ws);
}

/// Labels 1..n of the 8-connected components of nonzero pixels, 0 elsewhere, in order of their first
/// pixel row by row; `counts[label]` = pixels (counts[0] unused). Returns n.
inline int connected_components(ImageView<const std::uint8_t> mask, Image<int>& labels,
                                std::vector<int>& counts, MaskWorkspace& ws) {
  const int w = mask.width(), h = mask.height();
  labels.resize(w, h);
  ws.parent.assign(1, 0);
  const auto find = [&](int i) {
    while (ws.parent[static_cast<std::size_t>(i)] != i) {
      auto& p = ws.parent[static_cast<std::size_t>(i)];
      p = ws.parent[static_cast<std::size_t>(p)];
      i = p;
    }
    return i;
  };
  for (int v = 0; v < h; ++v) {
    for (int u = 0; u < w; ++u) {
      int label = 0;
      if (mask(u, v) != 0) {
        const auto join = [&](int du, int dv) {
          if (!mask.contains(u + du, v + dv)) return;
          const int other = labels(u + du, v + dv);
          if (other == 0) return;
          const int root = find(other);
          if (label == 0) {
            label = root;
          } else if (root != label) {  // the smaller label stays the root
            ws.parent[static_cast<std::size_t>(std::max(root, label))] = std::min(root, label);
            label = std::min(root, label);
          }
        };
        join(-1, 0);
        join(-1, -1);
        join(0, -1);
        join(1, -1);
        if (label == 0) {
          label = static_cast<int>(ws.parent.size());
          ws.parent.push_back(label);
        }
      }
      labels(u, v) = label;
    }
  }
  ws.size.assign(ws.parent.size(), 0);  // becomes the final label of each root
  int n = 0;
  for (int i = 1; i < static_cast<int>(ws.parent.size()); ++i) {
    if (find(i) == i) ws.size[static_cast<std::size_t>(i)] = ++n;
  }
  counts.assign(static_cast<std::size_t>(n) + 1, 0);
  for (int v = 0; v < h; ++v) {
    for (int u = 0; u < w; ++u) {
      int& label = labels(u, v);
      if (label == 0) continue;
      label = ws.size[static_cast<std::size_t>(find(label))];
      ++counts[static_cast<std::size_t>(label)];
    }
  }
  return n;
}

/// Clears the 8-connected components with fewer than `min_pixels` pixels.
inline void remove_small(ImageView<std::uint8_t> mask, int min_pixels, MaskWorkspace& ws) {
  connected_components(mask, ws.labels, ws.counts, ws);
  for (int v = 0; v < mask.height(); ++v) {
    for (int u = 0; u < mask.width(); ++u) {
      if (mask(u, v) != 0 && ws.counts[static_cast<std::size_t>(ws.labels(u, v))] < min_pixels)
        mask(u, v) = 0;
    }
  }
}

/// Sets (255) the components of zero pixels that do not touch the image border and have at most
/// `max_pixels` pixels.
inline void fill_holes(ImageView<std::uint8_t> mask, int max_pixels, MaskWorkspace& ws) {
  const int w = mask.width(), h = mask.height();
  ws.rows.resize(w, h);
  for (int v = 0; v < h; ++v) {
    for (int u = 0; u < w; ++u) ws.rows(u, v) = mask(u, v) == 0 ? 1 : 0;
  }
  connected_components(ws.rows.view(), ws.labels, ws.counts, ws);
  for (int u = 0; u < w; ++u)
    ws.counts[static_cast<std::size_t>(ws.labels(u, 0))] =
        ws.counts[static_cast<std::size_t>(ws.labels(u, h - 1))] = max_pixels + 1;
  for (int v = 0; v < h; ++v)
    ws.counts[static_cast<std::size_t>(ws.labels(0, v))] =
        ws.counts[static_cast<std::size_t>(ws.labels(w - 1, v))] = max_pixels + 1;
  for (int v = 0; v < h; ++v) {
    for (int u = 0; u < w; ++u) {
      if (mask(u, v) == 0 && ws.counts[static_cast<std::size_t>(ws.labels(u, v))] <= max_pixels)
        mask(u, v) = 255;
    }
  }
}

}  // namespace dynslam
