// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <type_traits>
#include <vector>

#include "dynslam/concepts/image.hpp"
#include "dynslam/image/pyramid.hpp"
#include "dynslam/segment/connected_components.hpp"
#include "dynslam/segment/leading_edge.hpp"
#include "dynslam/segment/pixel_runs.hpp"

namespace dynslam {

/// Options of image_motion() and cover_delay().
struct MaskDelayOptions {
  double reach = 0.1;  ///< greatest motion from frame to frame, as a share of the image's width; 0: none
  double least =
      1 / 40.0;        ///< width of the smallest square, as a share of the image's, whose motion is sought
  int samples = 200;   ///< pixels of a body, or of a piece of it, that are compared
  int candidates = 6;  ///< places that are looked at closely
  /// Share of what the compared pixels differ by at the next best place that they differ by at most where
  /// they have gone: what has no texture, or the same one again and again, tells nothing.
  double distinct = 0.85;
  double piece = 0.25;  ///< greatest width of what is taken to move as a whole, as a share of the image's
  /// By how much a piece may move otherwise than its body as a whole, as a share of the image's width.
  double spread = 0.04;
  LeadingEdgeOptions edge = {};
};

/// Nothing is known of where the room was.
struct UnknownRoom {
  [[nodiscard]] std::optional<Eigen::Vector2d> operator()(int, int) const { return std::nullopt; }
};

/// A place where a body may have come from, and by how much it differs there.
struct BodyPlace {
  Eigen::Vector2i shift;  ///< from the present to the last image [px of the level]
  double difference;      ///< standard deviation [grey levels]
};

/// Memory of cover_delay(); keep it between calls to avoid allocation.
struct MaskDelayWorkspace {
  ComponentsWorkspace components;
  std::vector<int> counts;
  std::vector<PixelRun> runs;   ///< of one component
  std::vector<PixelRun> piece;  ///< of them
  std::vector<Eigen::Vector2i> samples, placed;
  std::vector<BodyPlace> places;
  LeadingEdgeWorkspace edge;
};

namespace detail {
/// Standard deviation of the difference of grey values at `at` and, moved by d, in the last image: what light
/// and exposure add to all of them does not count. Infinity where too few are in the image.
template <class I>
[[nodiscard]] double moved_difference(const I& last, const I& present, std::span<const Eigen::Vector2i> at,
                                      const Eigen::Vector2i& d) {
  // Exact for whole grey levels, so that the order does not matter.
  using Sum =
      std::conditional_t<std::is_integral_v<std::remove_cvref_t<decltype(last(0, 0))>>, std::int64_t, double>;
  int n = 0;
  Sum sum = 0, squares = 0;
  for (const Eigen::Vector2i& p : at) {
    const int u = p.x() + d.x(), v = p.y() + d.y();
    if (u < 0 || v < 0 || u >= last.width() || v >= last.height()) continue;
    const Sum e = static_cast<Sum>(present(p.x(), p.y())) - static_cast<Sum>(last(u, v));
    sum += e;
    squares += e * e;
    ++n;
  }
  if (2 * static_cast<std::size_t>(n) < at.size() || n == 0) return std::numeric_limits<double>::infinity();
  const double mean = static_cast<double>(sum) / n;
  return std::sqrt(std::max(0.0, static_cast<double>(squares) / n - mean * mean));
}

/// The pixels of a level that show the samples, each once in a row.
template <class P>
void place_samples(const P& pyramid, int level, MaskDelayWorkspace& ws) {
  ws.placed.clear();
  const auto image = pyramid.image(level);
  for (const Eigen::Vector2i& s : ws.samples) {
    const Eigen::Vector2d x = to_level<double>(pyramid, s.cast<double>(), level);
    const Eigen::Vector2i p(std::clamp(static_cast<int>(std::lround(x.x())), 0, image.width() - 1),
                            std::clamp(static_cast<int>(std::lround(x.y())), 0, image.height() - 1));
    if (ws.placed.empty() || p != ws.placed.back()) ws.placed.push_back(p);
  }
}

/// Keeps the n places of least difference that are more than `apart` from each other, the best one first.
inline void keep_best(std::vector<BodyPlace>& places, int n, int apart) {
  std::size_t kept = 0;
  while (kept < places.size() && kept < static_cast<std::size_t>(n)) {
    const auto first = places.begin() + static_cast<std::ptrdiff_t>(kept);
    const auto best = std::min_element(
        first, places.end(), [](const auto& a, const auto& b) { return a.difference < b.difference; });
    std::iter_swap(first, best);
    ++kept;
    const Eigen::Vector2i at = first->shift;
    places.erase(std::remove_if(first + 1, places.end(),
                                [&](const auto& p) { return (p.shift - at).cwiseAbs().maxCoeff() <= apart; }),
                 places.end());
  }
  places.erase(places.begin() + static_cast<std::ptrdiff_t>(kept), places.end());
}

/// As image_motion(), with motions within `reach` of what is expected.
/// @param expected  motion [px of level 0]
/// @param reach     as a share of the image's width
template <ImagePyramidLike P>
[[nodiscard]] std::optional<Eigen::Vector2d> search_motion(const P& last, const P& present,
                                                           std::span<const PixelRun> runs,
                                                           const Eigen::Vector2d& expected, double reach,
                                                           const MaskDelayOptions& options,
                                                           MaskDelayWorkspace& ws) {
  const auto base = present.image(0);
  if (!same_size(last.image(0), base)) return std::nullopt;
  std::size_t pixels = 0;
  for (const PixelRun& run : runs) pixels += run.size();
  const std::size_t stride =
      std::max<std::size_t>(1, pixels / static_cast<std::size_t>(std::max(1, options.samples)));
  ws.samples.clear();
  std::size_t next = stride / 2;  // of the pixels in a row
  for (const PixelRun& run : runs) {
    for (; next < run.size(); next += stride)
      ws.samples.emplace_back(run.begin + static_cast<int>(next), run.v);
    next -= run.size();
  }
  int level = std::min(last.size(), present.size()) - 1;
  place_samples(present, level, ws);
  const auto difference = [&](const Eigen::Vector2i& d) {
    return moved_difference(last.image(level), present.image(level), ws.placed, d);
  };
  ws.places.clear();
  const Eigen::Vector2i middle =
      (-expected).cwiseQuotient(present.scale(level)).array().round().template cast<int>();
  const int places = static_cast<int>(std::ceil(reach * present.image(level).width()));
  for (int y = -places; y <= places; ++y) {
    for (int x = -places; x <= places; ++x) {
      const Eigen::Vector2i d = middle + Eigen::Vector2i(x, y);
      ws.places.push_back({d, difference(d)});
    }
  }
  keep_best(ws.places, options.candidates, 1);
  while (level > 1) {
    --level;
    place_samples(present, level, ws);
    for (BodyPlace& place : ws.places) {
      BodyPlace best{Eigen::Vector2i::Zero(), std::numeric_limits<double>::infinity()};
      for (int y = -1; y <= 1; ++y) {
        for (int x = -1; x <= 1; ++x) {
          const Eigen::Vector2i d = 2 * place.shift + Eigen::Vector2i(x, y);
          if (const double e = difference(d); e < best.difference) best = {d, e};
        }
      }
      place = best;
    }
  }
  keep_best(ws.places, 2, 3);
  if (ws.places.empty() || !std::isfinite(ws.places[0].difference)) return std::nullopt;
  if (ws.places.size() > 1 && !(ws.places[0].difference < options.distinct * ws.places[1].difference))
    return std::nullopt;
  const Eigen::Vector2i at = ws.places[0].shift;
  const Eigen::Vector2d motion = -present.scale(level).cwiseProduct(at.cast<double>());
  return motion;
}
}  // namespace detail

/// How far what the runs cover has moved in the image since the last frame, as a whole [px of level 0]: all
/// places within reach are tried on the coarsest level, the best ones are refined down to level 1. Nullopt:
/// nothing to be seen there, or no place is better than the others.
/// @param last, present  pyramids of grey images of one size
template <ImagePyramidLike P>
[[nodiscard]] std::optional<Eigen::Vector2d> image_motion(const P& last, const P& present,
                                                          std::span<const PixelRun> runs,
                                                          const MaskDelayOptions& options,
                                                          MaskDelayWorkspace& ws) {
  return detail::search_motion(last, present, runs, Eigen::Vector2d::Zero(), options.reach, options, ws);
}

namespace detail {
/// Adds runs, moved, to a mask. @return whether that is by a pixel or more
template <class Mask>
bool add_moved(std::span<const PixelRun> runs, const Eigen::Vector2d& by, Mask&& out) {
  using Pixel = typename std::remove_reference_t<Mask>::Pixel;
  const int x = static_cast<int>(std::lround(by.x())), y = static_cast<int>(std::lround(by.y()));
  if (x == 0 && y == 0) return false;
  for (const PixelRun& run : runs) {
    const PixelRun to{run.v + y, std::max(0, run.begin + x), std::min(out.width(), run.end + x)};
    if (to.v >= 0 && to.v < out.height() && to.begin < to.end) fill_run(out, to, static_cast<Pixel>(255));
  }
  return true;
}

/// Whether something that is not of the mask lies beside the runs, which are row by row.
template <class Mask>
[[nodiscard]] bool reaches_edge(std::span<const PixelRun> runs, const Mask& mask) {
  const auto beside = [&](int u, int v) {
    return u >= 0 && v >= 0 && u < mask.width() && v < mask.height() && mask(u, v) == 0;
  };
  for (const PixelRun& run : runs) {
    if (beside(run.begin - 1, run.v) || beside(run.end, run.v)) return true;
    if (run.v != runs.front().v && run.v != runs.back().v) continue;
    for (int u = run.begin; u < run.end; ++u) {
      if (beside(u, run.v - 1) || beside(u, run.v + 1)) return true;
    }
  }
  return false;
}

/// Calls visit(piece, alone) with what the runs, row by row, have in each square of a grid over them, of
/// squares no wider than `side`.
template <class Visit>
void for_each_piece(std::span<const PixelRun> runs, double side, std::vector<PixelRun>& piece,
                    Visit&& visit) {
  int begin = runs.front().begin, end = runs.front().end;
  for (const PixelRun& run : runs) {
    begin = std::min(begin, run.begin);
    end = std::max(end, run.end);
  }
  const int top = runs.front().v, bottom = runs.back().v + 1;
  const auto count = [&](int length) { return std::max(1, static_cast<int>(std::ceil(length / side))); };
  const int columns = count(end - begin), rows = count(bottom - top);
  const auto cut = [](int from, int to, int i, int n) { return from + (to - from) * i / n; };
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      const int left = cut(begin, end, c, columns), right = cut(begin, end, c + 1, columns);
      piece.clear();
      for (const PixelRun& run : runs) {
        if (run.v < cut(top, bottom, r, rows) || run.v >= cut(top, bottom, r + 1, rows)) continue;
        const PixelRun in{run.v, std::max(run.begin, left), std::min(run.end, right)};
        if (in.begin < in.end) piece.push_back(in);
      }
      if (!piece.empty()) visit(std::span<const PixelRun>(piece), columns * rows == 1);
    }
  }
}
}  // namespace detail

/// Where depth and colour are not taken at once, a mask of the depth image shows a mover where it was, or
/// will be, when the colour image was taken. Adds to each connected part of the mask where the colour image
/// has it, by its motion since the last frame: by the time between the images, and ahead of it as far as they
/// show it (cover_leading_edge()). A large part may turn, so its pieces move each in a way of its own.
/// @param last, present  pyramids of grey images of the mask's size, of the frame before and of this one
/// @param mask      of the depth image: nonzero in the mask
/// @param prior     of the colour image itself: parts of the mask that are mostly on it need no more; of
///                  another size: none
/// @param delay     of the depth image after the colour image, as a share of the time since the last frame
///                  (for what lies ahead it need not be exact); 0: at once, and nothing is added
/// @param covering  in and out: a mask, to which 255 is added
/// @param room      where the last image has what of the room is at a pixel, as for cover_leading_edge()
/// @return pieces that had moved
template <ImagePyramidLike P, LabelImage Mask, LabelImage Prior, OutputLabelImage Covering,
          class Room = UnknownRoom>
int cover_delay(const P& last, const P& present, const Mask& mask, const Prior& prior, double delay,
                const MaskDelayOptions& options, Covering&& covering, MaskDelayWorkspace& ws,
                const Room& room = {}) {
  if (!(options.reach > 0) || delay == 0 || last.size() == 0 || !same_size(present.image(0), mask) ||
      !same_size(mask, covering))
    return 0;
  const int n = detail::number_runs(mask, false, Connectivity::eight, ws.components);
  detail::count_pixels(ws.components, n, ws.counts);
  const double side = options.least * mask.width();
  const bool has_prior = same_size(prior, mask);
  int moved = 0;
  const auto cover = [&](std::span<const PixelRun> runs, const Eigen::Vector2d& motion) {
    const auto ahead =
        cover_leading_edge(last, present, runs, mask, motion, room, options.edge, covering, ws.edge);
    const bool late = detail::add_moved(runs, -delay * motion, covering);
    moved += late || ahead.value_or(0) > 0 ? 1 : 0;
  };
  for (int part = 1; part <= n; ++part) {
    const int pixels = ws.counts[static_cast<std::size_t>(part)];
    if (pixels < side * side) continue;
    ws.runs.clear();
    int known = 0;
    for (std::size_t i = 0; i < ws.components.runs.size(); ++i) {
      if (ws.components.number[i] != part) continue;
      const PixelRun& run = ws.runs.emplace_back(ws.components.runs[i]);
      for (int u = run.begin; has_prior && u < run.end; ++u) known += prior(u, run.v) != 0 ? 1 : 0;
    }
    if (2 * known > pixels) continue;
    const std::span<const PixelRun> runs(ws.runs);
    const auto whole = image_motion(last, present, runs, options, ws);
    const auto cover_piece = [&](std::span<const PixelRun> piece, bool alone) {
      if (!detail::reaches_edge(piece, mask)) return;
      auto motion = whole;
      if (!alone) {
        const auto own = detail::search_motion(last, present, piece, whole.value_or(Eigen::Vector2d::Zero()),
                                               whole ? options.spread : options.reach, options, ws);
        if (own) motion = own;
      }
      if (motion) cover(piece, *motion);
    };
    const double width = std::max({options.piece * mask.width(), side, 1.0});
    detail::for_each_piece(runs, width, ws.piece, cover_piece);
  }
  return moved;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
