// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <concepts>
#include <cstdint>

#include "dynslam/concepts/image.hpp"
#include "dynslam/image/depth.hpp"

namespace dynslam {

/// What an earlier depth image says of a surface point seen now.
enum class DepthEvidence : std::uint8_t {
  unknown,     ///< outside the earlier view, no depth there, or hidden behind what was seen then
  consistent,  ///< the same surface was seen then
  violation    ///< the earlier ray passed through the point: that space was free then
};

/// Margins of the comparison: `base + quad * z^2` metres, the shape of structured-light noise.
template <std::floating_point S>
struct FreeSpaceMargins {
  S consistent_base = S(0.03), consistent_quad = S(0.010);
  S violation_base = S(0.08), violation_quad = S(0.020);
};

/// Compares a point at depth `z` of an earlier view with the bounds of what was measured there.
///
/// The dense counterpart of Eq (6), E_D = (T P)_z - D, with the sign kept: a point nearer than the
/// earlier measurement contradicts it (something has come), one farther is merely hidden by it.
/// @param z  depth of the point in the earlier camera [m]
/// @param nearest, farthest  bounds at its projection [m]; NaN gives `unknown`
template <std::floating_point S>
[[nodiscard]] DepthEvidence free_space_evidence(S z, S nearest, S farthest,
                                                const FreeSpaceMargins<S>& margins) {
  if (!is_valid_depth(nearest)) return DepthEvidence::unknown;
  const S z2 = z * z;
  if (nearest - z > margins.violation_base + margins.violation_quad * z2) return DepthEvidence::violation;
  const S m = margins.consistent_base + margins.consistent_quad * z2;
  return z > nearest - m && z < farthest + m ? DepthEvidence::consistent : DepthEvidence::unknown;
}

/// Whether something nearer stands within `reach` pixels of one: a patch there may show its rim.
template <DepthImage D>
[[nodiscard]] bool beside_nearer(const D& depth, int u, int v, int reach,
                                 const FreeSpaceMargins<typename D::Pixel>& margins) {
  using Depth = typename D::Pixel;
  const Depth z = depth(u, v);
  for (int y = std::max(0, v - reach); y <= std::min(depth.height() - 1, v + reach); ++y) {
    for (int x = std::max(0, u - reach); x <= std::min(depth.width() - 1, u + reach); ++x) {
      const Depth near = depth(x, y);
      if (is_valid_depth(near) && free_space_evidence(near, z, z, margins) == DepthEvidence::violation)
        return true;
    }
  }
  return false;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
