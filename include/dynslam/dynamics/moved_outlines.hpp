// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "dynslam/dynamics/free_space.hpp"
#include "dynslam/dynamics/free_space_verdicts.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/segment/connectivity.hpp"
#include "dynslam/segment/growing_field.hpp"
#include "dynslam/segment/region_growing.hpp"

namespace dynslam {

/// What the outline of a surface tells of it. Counts are in cells of a grid of about 160 x 120.
struct MovedOutlineOptions {
  double share = 0.3;  ///< of an outline that must have moved for its surface to be a mover; above 1: never
  double sure = 0.7;   ///< from which on nothing speaks against that
  int moved = 20;      ///< cells of the outline that must have moved
  int at_rest =
      4;  ///< keypoints at rest on the surface from which on it is more than the mover, below `sure`
  /// Share of the other outlines that may have moved, below `sure`: where all of them have, the pose is
  /// wrong.
  double others = 0.1;
  /// Share of a surface's outline, as far as it is one with something nearer or farther, beside which
  /// something farther is seen, from which on the surface stands before the rest of the view.
  double foreground = 0.7;
  int keypoints = 15;  ///< on a surface of the foreground from which on they tell that it moves; 0: never
  double keypoint_share = 0.25;  ///< and share of all: with fewer the scale of all residuals is the others'
  double resting = 0.1;          ///< share of them that may be at rest then, while most of the others are
  int still = 40;  ///< cells of an outline that show, by not having moved, that its surface rests; 0: never
  int surface = 100;  ///< cells of the smallest surface
  int gap = 4;        ///< cells without depth between a surface and what lies behind it, at most
  int beside = 2;     ///< cells beside an outline in which what has gone or come is looked for
};

/// A connected surface and its outline: where something farther is seen beside it.
struct SurfaceOutline {
  std::size_t begin = 0, end = 0;  ///< of its runs in MovedOutlineWorkspace::runs
  int cells = 0;                   ///< sides of cells of the outline
  int moved = 0;                   ///< of them, beside which the surface was shortly before or has come to
  int hidden = 0;                  ///< sides of cells beside which something nearer hides the surface
  int fresh = 0;                   ///< seeds of age 0 on the surface

  [[nodiscard]] bool moved_by(double share) const { return moved >= share * cells; }
  /// Whether it stands before what is beside it.
  [[nodiscard]] bool in_foreground(const MovedOutlineOptions& options) const {
    return cells >= options.moved && cells >= options.foreground * (cells + hidden);
  }
  /// Whether it is seen not to have moved, and nothing else says so now.
  [[nodiscard]] bool still(const MovedOutlineOptions& options, int min_seeds) const {
    return options.still > 0 && cells >= options.still && 50 * moved < cells && fresh < min_seeds;
  }
};

/// Memory of outlines; keep it between calls to avoid allocation.
struct MovedOutlineWorkspace {
  RegionGrowingWorkspace growing;
  std::vector<PixelRun> runs;
  std::vector<SurfaceOutline> surfaces;
  Image<int> surface;  ///< of each cell, counted from 1; 0: none of them

  [[nodiscard]] std::span<const PixelRun> runs_of(const SurfaceOutline& s) const {
    return std::span(runs).subspan(s.begin, s.end - s.begin);
  }
  template <class F>
  void for_each_cell(const SurfaceOutline& s, const F& f) const {
    for (const PixelRun& run : runs_of(s)) {
      for (int u = run.begin; u < run.end; ++u) f(u, run.v);
    }
  }
};

namespace detail {
/// Looks along the outlines of surfaces.
template <class Step>
class OutlineWatch {
 public:
  OutlineWatch(const Image<float>& depth, const FreeSpaceVerdicts& verdicts, const Step& step,
               const FreeSpaceMargins<float>& margins, const MovedOutlineOptions& options)
      : depth_(depth), verdicts_(verdicts), step_(step), margins_(margins), options_(options) {}

  /// Counts the side (du, dv) of a surface's cell, if it is one of the outline.
  void look(int u, int v, int du, int dv, SurfaceOutline& outline) const {
    const float z = depth_(u, v);
    int gap = 0;  // the shadow of the sensor's projector
    int x = u + du, y = v + dv;
    while (inside(x, y) && !is_valid_depth(depth_(x, y)) && ++gap < options_.gap) {
      x += du;
      y += dv;
    }
    if (!inside(x, y) || !is_valid_depth(depth_(x, y))) return;
    const float behind = depth_(x, y);
    if (free_space_evidence(behind, z, z, margins_) == DepthEvidence::violation) ++outline.hidden;
    if (free_space_evidence(z, behind, behind, margins_) != DepthEvidence::violation) return;
    ++outline.cells;
    if (was_beside(u, v, du, dv, gap, z) || came(u, v, du, dv)) ++outline.moved;
  }

 private:
  [[nodiscard]] bool inside(int u, int v) const {
    return u >= 0 && v >= 0 && u < depth_.width() && v < depth_.height();
  }
  /// Whether the surface was there shortly before where one sees past it now.
  [[nodiscard]] bool was_beside(int u, int v, int du, int dv, int gap, float z) const {
    for (int i = 1; i <= gap + 1 + options_.beside; ++i) {
      for (const int side : {0, 1, -1}) {
        const int x = u + i * du + side * dv, y = v + i * dv + side * du;
        if (inside(x, y) && is_of_surface(verdicts_.gone(x, y), z)) return true;
      }
    }
    return false;
  }
  /// Three steps lead over the cells beside an outline, and over what a slope adds.
  [[nodiscard]] bool is_of_surface(float gone, float z) const {
    return gone > 0 && std::abs(gone - z) < 3 * (step_.base + step_.quad * z * z);
  }
  /// Whether it has come to where the space was free.
  [[nodiscard]] bool came(int u, int v, int du, int dv) const {
    for (int i = 0; i <= options_.beside && inside(u - i * du, v - i * dv); ++i) {
      if (fresh_seed(verdicts_, u - i * du, v - i * dv)) return true;
    }
    return false;
  }

  const Image<float>& depth_;
  const FreeSpaceVerdicts& verdicts_;
  const Step& step_;
  const FreeSpaceMargins<float>& margins_;
  const MovedOutlineOptions& options_;
};
}  // namespace detail

/// Finds the surfaces of a reduced depth image and how much of their outlines has moved.
///
/// Depth cannot tell whether the inside of a board slides in its own plane; its outline shows it: behind, one
/// sees past where the board was shortly before, and ahead it stands where the space was free. What is rigid
/// and connected moves as a whole, so the outline speaks for all of it, and against it, too.
/// @param depth     [m], invalid = NaN or <= 0
/// @param verdicts  of its cells: what is gone, and fresh evidence of what has come
/// @param step      between cells of one surface, as RelativeStep
/// @return surfaces of at least `options.surface` cells, in `ws`
template <class Step>
std::span<const SurfaceOutline> watch_outlines(const Image<float>& depth, const FreeSpaceVerdicts& verdicts,
                                               const Step& step, const FreeSpaceMargins<float>& margins,
                                               const MovedOutlineOptions& options,
                                               MovedOutlineWorkspace& ws) {
  const detail::NoBarrier nowhere;
  detail::GrowingField field(depth, nowhere, step, ws.growing.words);
  const detail::OutlineWatch watch(depth, verdicts, step, margins, options);
  ws.runs.clear();
  ws.surfaces.clear();
  ws.surface.resize(depth.width(), depth.height());
  ws.surface.fill(0);
  for (int v = 0; v < depth.height(); ++v) {
    for (int u = 0; u < depth.width(); ++u) {
      if (!field.open(u, v)) continue;
      SurfaceOutline s{.begin = ws.runs.size()};
      const std::size_t size = field.template take_region<Connectivity::four>(u, v, ws.runs);
      if (size < static_cast<std::size_t>(options.surface)) {
        ws.runs.resize(s.begin);
        continue;
      }
      s.end = ws.runs.size();
      for (const PixelRun& run : ws.runs_of(s)) {
        watch.look(run.begin, run.v, -1, 0, s);
        watch.look(run.end - 1, run.v, 1, 0, s);
        for (int x = run.begin; x < run.end; ++x) {
          watch.look(x, run.v, 0, -1, s);
          watch.look(x, run.v, 0, 1, s);
          s.fresh += fresh_seed(verdicts, x, run.v) ? 1 : 0;
        }
      }
      ws.surfaces.push_back(s);
      const auto index = static_cast<int>(ws.surfaces.size());
      ws.for_each_cell(s, [&](int x, int y) { ws.surface(x, y) = index; });
    }
  }
  return ws.surfaces;
}

/// Whether a surface is a mover by its outline.
/// @param at_rest  keypoints at rest that stand on it
[[nodiscard]] inline bool outline_moved(const SurfaceOutline& s, std::span<const SurfaceOutline> all,
                                        const MovedOutlineOptions& options, int at_rest) {
  if (s.moved < options.moved || !s.moved_by(options.share)) return false;
  if (s.moved_by(options.sure)) return true;
  int others = 0, others_moved = 0;
  for (const SurfaceOutline& o : all) {
    if (&o == &s || o.moved_by(options.sure)) continue;
    others += o.cells;
    others_moved += o.moved;
  }
  return others_moved <= options.others * others && at_rest <= options.at_rest;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
