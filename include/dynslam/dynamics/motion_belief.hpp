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

#include "dynslam/concepts/image.hpp"
#include "dynslam/dynamics/belief_pooling.hpp"
#include "dynslam/dynamics/depth_grid.hpp"
#include "dynslam/dynamics/free_space.hpp"
#include "dynslam/dynamics/free_space_history.hpp"
#include "dynslam/dynamics/motion_evidence.hpp"
#include "dynslam/dynamics/motion_result.hpp"
#include "dynslam/dynamics/moved_outlines.hpp"
#include "dynslam/geometry/rolling_shutter.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/segment/connectivity.hpp"
#include "dynslam/segment/mask.hpp"
#include "dynslam/segment/support_planes.hpp"

namespace dynslam {

/// Options of MotionBelief. Sizes are in cells of a grid of about 160 x 120.
struct MotionBeliefOptions {
  FreeSpaceOptions free_space;
  SupportPlaneOptions supports;
  MovedOutlineOptions outlines;
  SurfaceEvidenceOptions surfaces;
  PoolingOptions pooling;
  float most = 6;       ///< largest log-odds, so that a belief can change
  int min_region = 30;  ///< smaller dynamic regions are noise
  int max_hole = 600;   ///< larger holes in a dynamic region stay open
};

/// The log-odds that what is seen moves, for each cell of the reduced depth image:
///  1. predicted: a surface that was there in an earlier view keeps its belief, which decays to a prior;
///  2. observed: free space and support of earlier views (Eq 6, signed), and the outlines and keypoints (Eqs 3
///     to 7) of whole surfaces each add a bounded log-likelihood ratio;
///  3. pooled over connected surfaces (pool_beliefs());
///  4. thresholded: dynamic where it is above 0.
template <std::floating_point S>
class MotionBelief {
 public:
  explicit MotionBelief(const MotionBeliefOptions& options = {})
      : options_(options), history_(options.free_space) {}

  [[nodiscard]] const MotionEvidence& evidence() const { return evidence_; }

  /// Finds the dynamic cells of a frame at T_c_w.
  /// @param depth, smooth  as DepthGrid::reduce makes them
  /// @param t        of the frame [s]
  /// @param matches  classified keypoints
  /// @param mask     out: 255 where a cell is dynamic
  /// @return dynamic cells, before small regions are dropped and holes filled
  int update(const DepthGrid& grid, const Image<float>& depth, const Image<std::uint8_t>& smooth, double t,
             const SE3<S>& T_c_w, const RollingShutter<S>& shutter, std::span<const JudgedMatch<S>> matches,
             Image<std::uint8_t>& mask) {
    history_.check(grid, depth, smooth, t, T_c_w, evidence_, shutter);
    const auto surfaces = find_surfaces(grid, depth);
    count_keypoints(grid, depth, matches, surfaces.size());
    add_surfaces(surfaces);
    pool_beliefs(depth, evidence_.confidence, evidence_.belief, options_.pooling, pooling_);
    int dynamic = 0;
    for (std::size_t c = 0; c < grid.cells(); ++c) {
      float& l = evidence_.belief.data()[c];
      l = std::clamp(l, -options_.most, options_.most);
      const bool moves = l > 0 && is_valid_depth(depth.data()[c]);
      mask.data()[c] = moves ? 255 : 0;
      dynamic += moves ? 1 : 0;
    }
    if (dynamic == 0) return 0;
    remove_small(mask.view(), options_.min_region, morphology_);
    // What touches the outside at a corner is not counted as inside: it more often is seen past the object.
    fill_holes(mask.view(), options_.max_hole, Connectivity::eight, morphology_);
    return dynamic;
  }

  /// Keeps the frame last updated as evidence for later ones.
  /// @param mask  of the grid's image, nonzero where something was taken for dynamic in the end: elsewhere no
  /// belief in motion is kept
  template <LabelImage M>
  void remember(const DepthGrid& grid, const Image<float>& depth, double t, const SE3<S>& T_c_w,
                const M& mask) {
    const bool usable = mask.width() == grid.image_width() && mask.height() == grid.image_height();
    for (std::size_t c = 0; c < grid.cells(); ++c) {
      const RecordedPixel p = usable ? grid.pixel_of(c) : RecordedPixel();
      float& l = evidence_.belief.data()[c];
      if (p.u < 0 || mask(p.u, p.v) == 0) l = std::min(l, 0.0F);
    }
    history_.remember(depth, t, T_c_w, evidence_.belief);
  }

  /// Marks the cells of surfaces that stand before the rest of the view with 255; nothing need be known of
  /// motion.
  void mark_foreground(const DepthGrid& grid, const Image<float>& depth, Image<std::uint8_t>& mask) {
    forget_evidence(grid);
    mask.fill(0);
    for (const SurfaceOutline& s : find_surfaces(grid, depth)) {
      if (s.in_foreground(options_.outlines))
        outlines_.for_each_cell(s, [&](int u, int v) { mask(u, v) = 255; });
    }
  }

  /// Nothing is known of the cells of the present frame.
  void forget_evidence(const DepthGrid& grid) {
    evidence_.clear(grid.width(), grid.height(), options_.free_space.prior, options_.free_space.unseen);
  }

  void follow(const SE3<S>& D) { history_.follow(D); }
  void clear() { history_.clear(); }

 private:
  std::span<const SurfaceOutline> find_surfaces(const DepthGrid& grid, const Image<float>& depth) {
    split_supports(grid, depth, options_.pooling.step, options_.supports, plane_, supports_);
    return watch_outlines(depth, evidence_, options_.pooling.step, plane_, options_.free_space.margins,
                          options_.outlines, outlines_);
  }

  /// Counts the keypoints of each surface.
  void count_keypoints(const DepthGrid& grid, const Image<float>& depth,
                       std::span<const JudgedMatch<S>> matches, std::size_t surfaces) {
    const int w = grid.width();
    const int edge = static_cast<int>(std::lround(options_.surfaces.keypoint_edge * w));
    keypoints_.assign(surfaces + 1, {});
    for (const JudgedMatch<S>& m : matches) {
      const int c = grid.cell_at(static_cast<float>(m.x_m.x()), static_cast<float>(m.x_m.y()));
      if (c < 0) continue;
      if (m.dynamic && beside_nearer(depth, c % w, c / w, edge, options_.free_space.margins)) continue;
      keypoints_[static_cast<std::size_t>(outlines_.surface.data()[c])].add(m.dynamic);
    }
  }

  /// Adds what outlines and keypoints are evidence of for whole surfaces.
  void add_surfaces(std::span<const SurfaceOutline> surfaces) {
    const SurfaceEvidenceOptions& o = options_.surfaces;
    outline_.clear();
    outline_.emplace_back();  // of no surface
    for (const SurfaceOutline& s : surfaces) outline_.push_back({s.cells, s.moved});
    sort_by_share(outline_, by_outline_);
    sort_by_share(keypoints_, by_keypoints_);
    for (std::size_t k = 1; k <= surfaces.size(); ++k) {
      const SurfaceOutline& s = surfaces[k - 1];
      const int least = static_cast<int>(o.perimeter * std::sqrt(static_cast<double>(s.area)));
      const float ratio =
          surface_evidence({std::max(s.cells, least), s.moved}, share_of_others(outline_, by_outline_, k),
                           o.outline, o) +
          surface_evidence(keypoints_[k], share_of_others(keypoints_, by_keypoints_, k), o.keypoints, o);
      if (ratio == 0) continue;
      // No more is known of a cell by that: one that is new takes the belief of those beside it.
      outlines_.for_each_cell(s, [&](int u, int v) { evidence_.belief(u, v) += ratio; });
    }
  }

  MotionBeliefOptions options_;
  FreeSpaceHistory<S> history_;
  MotionEvidence evidence_;
  Image<int> plane_;  // of each cell; 0: none
  SupportPlaneWorkspace supports_;
  MovedOutlineWorkspace outlines_;
  std::vector<MovedShare> keypoints_, outline_;  // of each surface; the first: of none
  std::vector<std::size_t> by_keypoints_, by_outline_;
  PoolingWorkspace pooling_;
  MaskWorkspace morphology_;
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
