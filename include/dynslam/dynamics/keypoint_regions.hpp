// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "dynslam/dynamics/depth_grid.hpp"
#include "dynslam/dynamics/motion_result.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/segment/connected_components.hpp"
#include "dynslam/segment/mask_growing.hpp"
#include "dynslam/segment/support_planes.hpp"

namespace dynslam {

/// Which dynamic keypoints start the paper's region growing.
struct KeypointRegionOptions {
  double radius = 1 / 16.0;  ///< how near others count, as a share of the image's width
  int support = 8;  ///< dynamic ones that must be there, itself included, and not fewer than static ones
};

/// The paper's geometric mask (Sec. 3.3): regions of the depth image grown from dynamic keypoints. They enter
/// no floor, wall or table (split_supports()), and one that holds as many static keypoints as dynamic ones
/// has leaked, and is dropped. Memory is kept between frames.
template <std::floating_point S>
class KeypointRegions {
 public:
  /// @param depth  of the cells [m]
  /// @param mask   out: 255 in regions
  MaskGrowingResult find(std::span<const JudgedMatch<S>> matches, const DepthGrid& grid,
                         const Image<float>& depth, const KeypointRegionOptions& options,
                         const MaskGrowingOptions& growing, const SupportPlaneOptions& supports,
                         Image<std::uint8_t>& mask) {
    const S radius = S(options.radius * grid.image_width());
    const int w = grid.width(), h = grid.height();
    seed_.resize(w, h);
    seed_.fill(0);
    bool seeded = false;
    for (const JudgedMatch<S>& m : matches) {
      const int c = grid.cell_at(static_cast<float>(m.x_m.x()), static_cast<float>(m.x_m.y()));
      if (c < 0 || !m.dynamic) continue;
      const int i = c % w, j = c / w;
      int near = 0, near_static = 0;
      for (const JudgedMatch<S>& other : matches) {
        if ((other.x_m - m.x_m).cwiseAbs().maxCoeff() > radius) continue;
        ++(other.dynamic ? near : near_static);
      }
      if (near < near_static || near < options.support) continue;
      seeded = true;
      for (int y = std::max(0, j - 1); y <= std::min(h - 1, j + 1); ++y) {
        for (int x = std::max(0, i - 1); x <= std::min(w - 1, i + 1); ++x) seed_(x, y) = 1;
      }
    }
    if (!seeded) {
      mask.fill(0);
      return {};
    }
    split_supports(grid, depth, growing.step, supports, plane_, supports_);
    const MaskGrowingResult result = grow_mask(depth, seed_, plane_, mask, growing, workspace_);
    if (result.seeds > 0) drop_static(matches, grid, mask);
    return result;
  }

 private:
  void drop_static(std::span<const JudgedMatch<S>> matches, const DepthGrid& grid,
                   Image<std::uint8_t>& mask) {
    const int n = connected_components(mask, Connectivity::four, regions_, sizes_, components_);
    votes_.assign(static_cast<std::size_t>(n) + 1, 0);
    for (const JudgedMatch<S>& m : matches) {
      const int c = grid.cell_at(static_cast<float>(m.x_m.x()), static_cast<float>(m.x_m.y()));
      if (c >= 0) votes_[static_cast<std::size_t>(regions_.data()[c])] += m.dynamic ? 1 : -1;
    }
    for (std::size_t c = 0; c < grid.cells(); ++c) {
      if (votes_[static_cast<std::size_t>(regions_.data()[c])] <= 0) mask.data()[c] = 0;
    }
  }

  Image<std::uint8_t> seed_;
  Image<int> plane_;  // of each cell; 0: none
  SupportPlaneWorkspace supports_;
  MaskGrowingWorkspace workspace_;
  Image<int> regions_;
  std::vector<int> sizes_, votes_;
  ComponentsWorkspace components_;
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
