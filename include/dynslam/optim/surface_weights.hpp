// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <span>
#include <type_traits>
#include <vector>

#include "dynslam/geometry/se3.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/optim/pose_residual.hpp"

namespace dynslam {

/// How surface_weights() divides the image.
template <Scalar S>
struct SurfaceOptions {
  S step = S(1) / S(32);    ///< between the places that are given to an observation [share of the width]
  S reach = S(5) / S(32);   ///< farther from every observation, a place is given to none [share of the width]
  S max_depth = S(4);       ///< farther surfaces count as if they were there [m]
  S crowded_out = S(0.25);  ///< places of an observation to which none is nearest: it still counts a little
};

/// Weights with which observations count by the surface that they stand for: each place of the image belongs
/// to the nearest observation, and counts with its depth. Of several motions that are seen, the scene's is
/// the one that most surface shares. Features do not tell: a poster that is carried past has more of them
/// than the room behind it; nor do pixels: what moves is in front of what does not, and looks large. A
/// place's surface grows with z^2, but so does the noise of its depth; z is between the two.
/// @param width, height  of the image [px]
/// @param T_c_w  rough pose, for depths that were not measured
/// @param out    one positive weight per observation [places x m], also of one that is not finite
template <std::floating_point S>
void surface_weights(int width, int height, const SE3<S>& T_c_w,
                     std::span<const PoseObservation<std::type_identity_t<S>>> observations,
                     const SurfaceOptions<S>& options, std::vector<S>& out) {
  const int step = std::max(1, static_cast<int>(std::lround(options.step * S(width))));
  const S reach = options.reach * S(width);
  out.assign(observations.size(), options.crowded_out);
  for (int v = step / 2; v < height; v += step) {
    for (int u = step / 2; u < width; u += step) {
      S nearest = reach * reach;
      std::size_t owner = observations.size();
      for (std::size_t k = 0; k < observations.size(); ++k) {
        const S dx = observations[k].x.x() - S(u), dy = observations[k].x.y() - S(v);
        const S distance2 = dx * dx + dy * dy;
        if (distance2 < nearest) {
          nearest = distance2;
          owner = k;
        }
      }
      if (owner < observations.size()) out[owner] += S(1);
    }
  }
  for (std::size_t k = 0; k < out.size(); ++k) {
    const PoseObservation<S>& o = observations[k];
    // In this order, so that what is not a number is as far as may be: one bad point spoils its weight alone.
    const S z =
        std::min(options.max_depth, is_valid_depth(o.depth) ? o.depth : std::abs((T_c_w * o.p_w).z()));
    out[k] *= z;
  }
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
