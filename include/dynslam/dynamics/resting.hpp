// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <type_traits>
#include <utility>
#include <vector>

#include "dynslam/concepts/image.hpp"
#include "dynslam/config.hpp"
#include "dynslam/image/depth.hpp"

namespace dynslam {

/// When something that could move counts as at rest.
template <std::floating_point S>
struct RestingOptions {
  int stride = 4;          ///< pixels between the samples of a surface
  int min_samples = 40;    ///< with depth: of less nothing is known
  S min_still = S(0.4);    ///< share of the samples that were seen in the same place long before
  S max_moving = S(0.05);  ///< share of the samples on the mask of what moves
};

/// Splits instances by the surfaces that they lie on: what a network takes for one thing may be a mover and
/// the desk below it, of which only one is at rest.
/// @param instances  0 = none, else the instance's number, any that its type has
/// @param surface    surface(u, v) -> int: number of the connected surface at a pixel
/// @param parts      out, of the same size: 0 = none, else the part's number, counted in the order of the
/// rows
/// @return how many parts there are; beyond what a pixel of `parts` can hold, they are one with the last
template <LabelImage Instances, class Surface, OutputLabelImage Parts>
std::size_t split_instances(const Instances& instances, Surface&& surface, Parts&& parts) {
  DYNSLAM_ASSERT(instances.width() == parts.width() && instances.height() == parts.height(),
                 "both images have the same size");
  using Id = typename Instances::Pixel;
  using Number = typename std::remove_reference_t<Parts>::Pixel;
  constexpr auto kMost = static_cast<std::uintmax_t>(std::numeric_limits<Number>::max());
  std::map<std::pair<Id, std::int64_t>, Number> known;  // instance and surface of each part
  auto last = known.end();                              // neighbours mostly are of one part
  for (int v = 0; v < instances.height(); ++v) {
    for (int u = 0; u < instances.width(); ++u) {
      const Id id = instances(u, v);
      if (id <= 0) {
        parts(u, v) = 0;
        continue;
      }
      const std::pair<Id, std::int64_t> at(id, surface(u, v));
      if (last == known.end() || last->first != at) {
        last = known.find(at);
        if (last == known.end() && known.size() < kMost)
          last = known.emplace(at, static_cast<Number>(known.size() + 1)).first;
      }
      parts(u, v) = last == known.end() ? static_cast<Number>(kMost) : last->second;
    }
  }
  return known.size();
}

/// Instances on the a-priori mask that are at rest, such as people who sit: their points may serve the pose.
/// What it costs goes by the samples, whatever the instances' numbers.
/// @param instances  0 = none, else the instance's number, or that of its part (split_instances())
/// @param prior      nonzero = may move
/// @param depth      [m]
/// @param moving     nonzero = seen to move
/// @param verified   verified(u, v) -> bool: the surface at a pixel was seen in the same place long before
/// @return numbers of the instances at rest, ascending. All images have the same size.
template <LabelImage Instances, LabelImage Prior, DepthImage Depth, LabelImage Moving, class Verified,
          std::floating_point S>
[[nodiscard]] std::vector<typename Instances::Pixel> resting_instances(const Instances& instances,
                                                                       const Prior& prior, const Depth& depth,
                                                                       const Moving& moving,
                                                                       Verified&& verified,
                                                                       const RestingOptions<S>& options) {
  DYNSLAM_ASSERT(instances.width() == prior.width() && instances.height() == prior.height() &&
                     instances.width() == depth.width() && instances.height() == depth.height() &&
                     instances.width() == moving.width() && instances.height() == moving.height(),
                 "all images have the same size");
  using Id = typename Instances::Pixel;
  struct Count {
    int seen = 0, still = 0, moving = 0;
  };
  std::map<Id, Count> counts;
  for (int v = 0; v < instances.height(); v += options.stride) {
    for (int u = 0; u < instances.width(); u += options.stride) {
      const Id id = instances(u, v);
      if (id <= 0 || prior(u, v) == 0 || !is_valid_depth(depth(u, v))) continue;
      Count& count = counts[id];
      ++count.seen;
      count.still += verified(u, v) ? 1 : 0;
      count.moving += moving(u, v) != 0 ? 1 : 0;
    }
  }
  std::vector<Id> resting;
  for (const auto& [id, c] : counts) {
    const auto seen = static_cast<S>(c.seen);
    if (c.seen >= options.min_samples && static_cast<S>(c.still) >= options.min_still * seen &&
        static_cast<S>(c.moving) <= options.max_moving * seen)
      resting.push_back(id);
  }
  return resting;
}

/// Gives back what is at rest: clears its pixels in a mask of what moves and marks them (255) in one of what
/// rests.
/// @param resting  ascending, as resting_instances() returns it
template <LabelImage Instances, OutputLabelImage Dynamic, OutputLabelImage Rest>
void give_back_resting(const Instances& instances, const std::vector<typename Instances::Pixel>& resting,
                       Dynamic&& dynamic, Rest&& at_rest) {
  if (resting.empty()) return;
  for (int v = 0; v < instances.height(); ++v) {
    for (int u = 0; u < instances.width(); ++u) {
      if (!std::binary_search(resting.begin(), resting.end(), instances(u, v))) continue;
      dynamic(u, v) = 0;
      at_rest(u, v) = static_cast<typename std::remove_reference_t<Rest>::Pixel>(255);
    }
  }
}

/// Marks (255) what stands still wherever that is known, whoever it belongs to: a wall that is called a
/// person, what a mask shows that is late or beside what it means, the legs of somebody who turns the head.
/// @param moving    nonzero = seen to move, with a margin
/// @param verified  verified(u, v) -> bool: the surface at a pixel was seen in the same place long before
/// @param stride    pixels: `verified` is asked once per stride x stride of them, in their middle
/// @param still     out, of the size of `moving`: 255 where something stands, as it was elsewhere
template <LabelImage Moving, class Verified, OutputLabelImage Still>
void mark_standing(const Moving& moving, Verified&& verified, int stride, Still&& still) {
  DYNSLAM_ASSERT(still.width() == moving.width() && still.height() == moving.height(),
                 "both images have the same size");
  const int w = moving.width(), h = moving.height();
  for (int v0 = 0; v0 < h; v0 += stride) {
    const int v1 = std::min(h, v0 + stride);
    for (int u0 = 0; u0 < w; u0 += stride) {
      const int u1 = std::min(w, u0 + stride);
      if (!verified((u0 + u1) / 2, (v0 + v1) / 2)) continue;
      for (int v = v0; v < v1; ++v) {
        for (int u = u0; u < u1; ++u) {
          if (moving(u, v) == 0)
            still(u, v) = static_cast<typename std::remove_reference_t<Still>::Pixel>(255);
        }
      }
    }
  }
}

}  // namespace dynslam
