// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <optional>
#include <span>
#include <type_traits>
#include <vector>

#include "dynslam/concepts/image.hpp"
#include "dynslam/image/pyramid.hpp"
#include "dynslam/segment/pixel_runs.hpp"

namespace dynslam {

/// Options of cover_leading_edge().
struct LeadingEdgeOptions {
  double reach = 1;   ///< how far ahead is looked, as a share of the motion since the last frame; 0: nowhere
  double margin = 1;  ///< grey levels by which a pixel has to look more like the body than like the room
  double most = 20;   ///< grey levels that one pixel counts for at most
  double enough = 5;  ///< grey levels per line that goes ahead, of those asked together, that do tell
  double together = 1 / 64.0;  ///< how far along the edge pixels are asked together, as a share of the width
  int least = 50;              ///< pixels that have to tell, for the answer to be one
};

/// Memory of cover_leading_edge(); keep it between calls to avoid allocation.
struct LeadingEdgeWorkspace {
  std::vector<Eigen::Vector2i> starts;  ///< of the lines that go ahead
  std::vector<double> votes;            ///< of each line, up to each step: grey levels in the room's favour
};

namespace detail {
/// Mean difference of 3 x 3 pixels around p and, in the last image, around q; nullopt at either's rim.
template <class I>
[[nodiscard]] std::optional<double> patch_difference(const I& last, const I& present,
                                                     const Eigen::Vector2i& p, const Eigen::Vector2i& q) {
  const auto inside = [&](const Eigen::Vector2i& x) {
    return x.x() > 0 && x.y() > 0 && x.x() + 1 < present.width() && x.y() + 1 < present.height();
  };
  if (!inside(p) || !inside(q)) return std::nullopt;
  double sum = 0;
  for (int y = -1; y <= 1; ++y) {
    for (int x = -1; x <= 1; ++x)
      sum += std::abs(static_cast<double>(present(p.x() + x, p.y() + y)) -
                      static_cast<double>(last(q.x() + x, q.y() + y)));
  }
  return sum / 9;
}

/// The step up to which line i and those that start within `near` of it have most votes for the body; 0: less
/// than `enough` a line.
[[nodiscard]] inline int farthest_step(const LeadingEdgeWorkspace& ws, std::ptrdiff_t i, int steps, int near,
                                       double enough) {
  // Lines are in the order of rows: neighbours are near in it, too.
  const auto begin = ws.starts.begin();
  const std::ptrdiff_t first = std::max<std::ptrdiff_t>(0, i - near);
  const std::ptrdiff_t end = std::min(std::ssize(ws.starts), i + near + 1);
  const auto together = [&](std::ptrdiff_t j) { return (begin[j] - begin[i]).cwiseAbs().maxCoeff() <= near; };
  double least = 0;
  for (std::ptrdiff_t j = first; j < end; ++j) least -= together(j) ? enough : 0;
  int best = 0;
  for (int k = 1; k <= steps; ++k) {
    double sum = 0;
    for (std::ptrdiff_t j = first; j < end; ++j) {
      if (together(j)) sum += ws.votes[static_cast<std::size_t>(j * steps + k - 1)];
    }
    if (sum < least) {
      least = sum;
      best = k;
    }
  }
  return best;
}
}  // namespace detail

/// Adds to a mask what a moving body has ahead of it in the grey image, where the mask is of a depth image
/// that was not taken when the grey one was, or has not all of the body: each pixel ahead of the edge looks
/// in the last image either like the one from which the body came, or like the room that it had not covered
/// yet. Along each line that goes ahead, all up to where the body explains most is added.
/// @param last, present  pyramids of grey images of one size
/// @param runs      of the body in the mask
/// @param mask      nonzero: no pixel of this is asked
/// @param motion    of the body in the image since the last frame [px], as of image_motion()
/// @param room      callable (u, v) -> std::optional<Eigen::Vector2d>: where the last image has what of the
///                  room is at a pixel; nullopt: not known
/// @param covering  in and out: the mask to which 255 is added
/// @return pixels added, about; nullopt: too little tells
template <ImagePyramidLike P, LabelImage Mask, class Room, OutputLabelImage Covering>
std::optional<int> cover_leading_edge(const P& last, const P& present, std::span<const PixelRun> runs,
                                      const Mask& mask, const Eigen::Vector2d& motion, const Room& room,
                                      const LeadingEdgeOptions& options, Covering&& covering,
                                      LeadingEdgeWorkspace& ws) {
  using Pixel = typename std::remove_reference_t<Covering>::Pixel;
  const double length = motion.cwiseAbs().maxCoeff();
  const int level = std::min({1, last.size() - 1, present.size() - 1});
  if (level < 0) return std::nullopt;
  // A pixel of the level at a time, along every other line.
  const int stride = std::max(1, static_cast<int>(std::lround(present.scale(level).minCoeff())));
  const int steps = static_cast<int>(options.reach * length) / stride;
  if (steps <= 0 || !same_size(last.image(level), present.image(level)) || !same_size(present.image(0), mask))
    return std::nullopt;
  const Eigen::Vector2d step = motion * (stride / length);
  const auto image = present.image(level), before = last.image(level);
  const auto on_level = [&](const Eigen::Vector2d& x) {
    return Eigen::Vector2i(to_level<double>(present, x, level).array().round().template cast<int>());
  };
  const auto at = [&](const Eigen::Vector2i& start, int k) {
    return Eigen::Vector2i(start.x() + static_cast<int>(std::lround(k * step.x())),
                           start.y() + static_cast<int>(std::lround(k * step.y())));
  };
  const auto free = [&](const Eigen::Vector2i& x) {
    return x.x() >= 0 && x.y() >= 0 && x.x() < mask.width() && x.y() < mask.height() &&
           mask(x.x(), x.y()) == 0;
  };
  int told = 0;
  const auto ask = [&](const Eigen::Vector2i& pixel) {  // grey levels in the room's favour
    const auto seen = room(pixel.x(), pixel.y());
    if (!seen) return 0.0;
    const Eigen::Vector2d x = pixel.cast<double>();
    const Eigen::Vector2i p = on_level(x);
    const auto as_body = detail::patch_difference(before, image, p, on_level(x - motion));
    const auto as_room = detail::patch_difference(before, image, p, on_level(*seen));
    if (!as_body || !as_room) return 0.0;
    ++told;
    return std::clamp(*as_body - *as_room, -options.most, options.most) + options.margin;
  };
  ws.starts.clear();
  ws.votes.clear();
  for (const PixelRun& run : runs) {
    if (run.v % stride != 0) continue;
    for (int u = run.begin; u < run.end; u += stride) {
      const Eigen::Vector2i start(u, run.v);
      if (!free(at(start, 1))) continue;
      ws.starts.push_back(start);
      bool on = true;
      double sum = 0;
      for (int k = 1; k <= steps; ++k) {
        const Eigen::Vector2i to = at(start, k);
        on = on && free(to);
        if (on) sum += ask(to);
        ws.votes.push_back(sum);
      }
    }
  }
  if (told < options.least) return std::nullopt;
  int added = 0;
  const int near = static_cast<int>(std::lround(options.together * mask.width()));
  for (std::ptrdiff_t i = 0; i < std::ssize(ws.starts); ++i) {
    const Eigen::Vector2i start = ws.starts[static_cast<std::size_t>(i)];
    const int best = detail::farthest_step(ws, i, steps, near, options.enough);
    for (int k = 1; k <= best; ++k) {
      const Eigen::Vector2i to = at(start, k);
      if (!free(to)) break;
      const int end = std::min(mask.width(), to.x() + stride);
      for (int v = to.y(); v < std::min(mask.height(), to.y() + stride); ++v)
        detail::fill_run(covering, PixelRun{v, to.x(), end}, static_cast<Pixel>(255));
      added += stride * stride;
    }
  }
  return added;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
