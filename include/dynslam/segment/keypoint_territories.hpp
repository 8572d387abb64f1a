// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "dynslam/concepts/image.hpp"
#include "dynslam/config.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/segment/connected_components.hpp"
#include "dynslam/segment/connectivity.hpp"
#include "dynslam/segment/growing_criteria.hpp"
#include "dynslam/segment/region_growing.hpp"

namespace dynslam {

/// A pixel with a verdict on the keypoint that lies there.
struct VerdictSite {
  int u = 0, v = 0;
  bool moving = false;
};

/// How far a keypoint speaks for the surface around it.
struct TerritoryOptions {
  int reach = 12;         ///< steps over the surface within which a keypoint speaks for it; 0: for nothing
  int min_keypoints = 8;  ///< moving ones that together make a surface move; fewer may all be wrong
};

/// Memory of keypoint territories; keep it between calls to avoid allocation.
struct TerritoryWorkspace {
  std::vector<PixelIndex> front, next;
  Image<std::uint8_t> owner;
  ComponentsWorkspace components;
  std::vector<int> counts;     ///< pixels per part
  std::vector<int> keypoints;  ///< out: moving ones per part, from 1 on
};

/// Where keypoints that move speak for the surface between them: every pixel belongs to the keypoint that
/// reaches it first, over steps that the criterion allows. Depth cannot tell a board that slides in its own
/// plane from one at rest; texture can, but only where there is a keypoint.
/// @param depth   [m], invalid = NaN or <= 0
/// @param sites   keypoints that were judged, inside the image; of two on one pixel the first counts
/// @param parts   out, of the depth's size: 1 to n in the n connected parts that belong to moving keypoints,
/// 0
///                elsewhere and in parts with fewer than `min_keypoints` of them
/// @return n, those that are too small included
template <DepthImage D, class Criterion>
  requires GrowingCriterion<Criterion, typename D::Pixel>
int keypoint_territories(const D& depth, std::span<const VerdictSite> sites, const Criterion& criterion,
                         const TerritoryOptions& options, Image<int>& parts, TerritoryWorkspace& ws) {
  using S = typename D::Pixel;
  constexpr std::uint8_t kNobody = 0, kMoving = 255, kStill = 1;
  const int w = depth.width(), h = depth.height();
  parts.resize(w, h);
  parts.fill(0);
  ws.keypoints.clear();
  if (options.reach <= 0 ||
      std::ranges::count_if(sites, &VerdictSite::moving) < std::max(1, options.min_keypoints))
    return 0;
  ws.owner.resize(w, h);
  ws.owner.fill(kNobody);
  ws.front.clear();
  for (const VerdictSite& s : sites) {
    DYNSLAM_ASSERT(s.u >= 0 && s.v >= 0 && s.u < w && s.v < h, "a keypoint lies in the image");
    if (!is_valid_depth(depth(s.u, s.v)) || ws.owner(s.u, s.v) != kNobody) continue;
    ws.owner(s.u, s.v) = s.moving ? kMoving : kStill;
    ws.front.push_back({s.u, s.v});
  }
  for (int step = 0; step < options.reach && !ws.front.empty(); ++step) {
    ws.next.clear();
    for (const PixelIndex& p : ws.front) {
      const GrowingSite<S> from{p.u, p.v, depth(p.u, p.v)};
      for (const auto& [du, dv] : {std::array{-1, 0}, {1, 0}, {0, -1}, {0, 1}}) {
        const int u = p.u + du, v = p.v + dv;
        if (u < 0 || v < 0 || u >= w || v >= h || ws.owner(u, v) != kNobody) continue;
        if (!is_valid_depth(depth(u, v)) || !may_step(criterion, from, GrowingSite<S>{u, v, depth(u, v)}))
          continue;
        ws.owner(u, v) = ws.owner(p.u, p.v);
        ws.next.push_back({u, v});
      }
    }
    std::swap(ws.front, ws.next);
  }
  for (int v = 0; v < h; ++v) {
    for (int u = 0; u < w; ++u) ws.owner(u, v) = ws.owner(u, v) == kMoving ? 1 : 0;
  }
  const int n = connected_components(ws.owner, Connectivity::four, parts, ws.counts, ws.components);
  ws.keypoints.assign(static_cast<std::size_t>(n) + 1, 0);
  for (const VerdictSite& s : sites)
    ws.keypoints[static_cast<std::size_t>(parts(s.u, s.v))] += s.moving ? 1 : 0;
  for (int v = 0; v < h; ++v) {
    for (int u = 0; u < w; ++u) {
      if (ws.keypoints[static_cast<std::size_t>(parts(u, v))] < options.min_keypoints) parts(u, v) = 0;
    }
  }
  return n;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
