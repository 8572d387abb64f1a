// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <span>
#include <vector>

#include "dynslam/dynamics/free_space.hpp"
#include "dynslam/dynamics/motion_evidence.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/segment/connectivity.hpp"
#include "dynslam/segment/detail/growing_field.hpp"
#include "dynslam/segment/growing_criteria.hpp"
#include "dynslam/segment/region_growing.hpp"

namespace dynslam {

/// How the outline and the keypoints of a surface are evidence for all of it.
struct SurfaceEvidenceOptions {
  double share = 0.25;               ///< by which more of it must have moved than of the others
  double slope = 10;                 ///< log-likelihood ratio per share beyond that
  double most = 3, most_rest = 0.5;  ///< greatest ratio for motion and for rest
  /// Least outline of a surface of n cells, in sqrt(n) sides: a square has 4. Where less is its own
  /// silhouette, as of an object that stands on a floor and the floor, the rest counts as not moved.
  double perimeter = 3.5;
  int outline = 20;    ///< least sides of cells,
  int keypoints = 15;  ///< and keypoints, that are evidence
  /// How near to something nearer, as a share of the image's width, a keypoint's patch may show the other's
  /// edge: such a dynamic keypoint is no evidence for the surface behind.
  double keypoint_edge = 1 / 80.0;
};

/// What the outline of a surface tells of it. Counts are in cells of a grid of about 160 x 120.
struct MovedOutlineOptions {
  /// Share of a surface's outline, as far as it is one with something nearer or farther, beside which
  /// something farther is seen, from which on the surface stands before the rest of the view.
  double foreground = 0.7;
  int least = 20;     ///< cells of the outline of such a surface
  int surface = 100;  ///< cells of the smallest surface
  int gap = 4;        ///< cells without depth between a surface and what lies behind it, at most
  int beside = 2;     ///< cells beside an outline in which what has gone or come is looked for
};

/// A connected surface and its outline: where something farther is seen beside it.
struct SurfaceOutline {
  std::size_t begin = 0, end = 0;  ///< of its runs in MovedOutlineWorkspace::runs
  int cells = 0;                   ///< sides of cells of the outline
  int moved = 0;                   ///< of them, beside which the surface was shortly before or has come to
  int area = 0;                    ///< cells of the surface
  int hidden = 0;                  ///< sides of cells beside which something nearer hides the surface

  /// Whether it stands before what is beside it.
  [[nodiscard]] bool in_foreground(const MovedOutlineOptions& options) const {
    return cells >= options.least && cells >= options.foreground * (cells + hidden);
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
  OutlineWatch(const Image<float>& depth, const MotionEvidence& evidence, const Step& step,
               const FreeSpaceMargins<float>& margins, const MovedOutlineOptions& options)
      : depth_(depth), evidence_(evidence), step_(step), margins_(margins), options_(options) {}

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
        if (inside(x, y) && is_of_surface(evidence_.gone(x, y), z)) return true;
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
      if (evidence_.fresh(u - i * du, v - i * dv) != 0) return true;
    }
    return false;
  }

  const Image<float>& depth_;
  const MotionEvidence& evidence_;
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
/// @param evidence  of its cells: what is gone, and fresh evidence of what has come
/// @param step      between cells of one surface, as RelativeStep
/// @param plane     of each cell, as split_supports() numbers them: a surface does not go on from one to
/// another
/// @return surfaces of at least `options.surface` cells, in `ws`
template <class Step>
std::span<const SurfaceOutline> watch_outlines(const Image<float>& depth, const MotionEvidence& evidence,
                                               const Step& step, const Image<int>& plane,
                                               const FreeSpaceMargins<float>& margins,
                                               const MovedOutlineOptions& options,
                                               MovedOutlineWorkspace& ws) {
  const detail::NoBarrier nowhere;
  const SameLabelStep within(plane, step);
  detail::GrowingField field(depth, nowhere, within, ws.growing.words);
  const detail::OutlineWatch watch(depth, evidence, step, margins, options);
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
      s.area = static_cast<int>(size);
      for (const PixelRun& run : ws.runs_of(s)) {
        watch.look(run.begin, run.v, -1, 0, s);
        watch.look(run.end - 1, run.v, 1, 0, s);
        for (int x = run.begin; x < run.end; ++x) {
          watch.look(x, run.v, 0, -1, s);
          watch.look(x, run.v, 0, 1, s);
        }
      }
      ws.surfaces.push_back(s);
      const auto index = static_cast<int>(ws.surfaces.size());
      ws.for_each_cell(s, [&](int x, int y) { ws.surface(x, y) = index; });
    }
  }
  return ws.surfaces;
}

/// Parts of a whole that have moved.
struct MovedShare {
  int all = 0, moved = 0;
  void add(bool has_moved) {
    ++all;
    moved += has_moved ? 1 : 0;
  }
  [[nodiscard]] double share() const { return all > 0 ? static_cast<double>(moved) / all : 0.0; }
};

/// Orders the indices of surfaces by share, the least first.
inline void sort_by_share(std::span<const MovedShare> surfaces, std::vector<std::size_t>& order) {
  order.resize(surfaces.size());
  std::iota(order.begin(), order.end(), std::size_t(0));
  std::ranges::sort(order, {}, [&](std::size_t k) { return surfaces[k].share(); });
}

/// Share of the surfaces but one that has moved: their median, each weighted by its number of parts. Other
/// movers do not count; where most surfaces have moved, the pose is wrong.
/// @param by_share  sort_by_share() of `surfaces`
[[nodiscard]] inline double share_of_others(std::span<const MovedShare> surfaces,
                                            std::span<const std::size_t> by_share, std::size_t one) {
  int all = 0;
  for (const MovedShare& s : surfaces) all += s.all;
  all -= surfaces[one].all;
  int below = 0;
  for (const std::size_t k : by_share) {
    if (k == one) continue;
    below += surfaces[k].all;
    if (2 * below >= all) return surfaces[k].share();
  }
  return 0;
}

/// What parts of a surface say of all of it, as a log-likelihood ratio of motion. What counts is how much
/// more of it has moved than of others.
[[nodiscard]] inline float surface_evidence(const MovedShare& own, double others, int least,
                                            const SurfaceEvidenceOptions& o) {
  if (own.all < least) return 0;
  return static_cast<float>(std::clamp(o.slope * (own.share() - others - o.share), -o.most_rest, o.most));
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
