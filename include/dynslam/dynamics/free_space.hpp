// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "dynslam/concepts/image.hpp"
#include "dynslam/concepts/scalar.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/image/image.hpp"

namespace dynslam {

/// What an earlier depth image says of a surface point seen now.
enum class DepthEvidence : std::uint8_t {
  unknown,     ///< outside the earlier view, no depth there, or hidden behind what was seen then
  consistent,  ///< the same surface was seen then
  violation    ///< the earlier ray passed through the point: that space was free then
};

/// Smallest and largest depth in the 3x3 neighbourhood of each pixel [m]; NaN where fewer than
/// `min_valid` of the nine are valid.
///
/// With the two bounds a comparison tolerates an error of one pixel in pose and time stamp without
/// looking at nine pixels each time: a point is a violation only when it lies in front of all of
/// them, and consistent when it lies between them.
template <std::floating_point S>
struct DepthBounds {
  Image<S> nearest, farthest;

  /// Recomputes the bounds of `depth` (metres, invalid = NaN or <= 0); memory is reused.
  template <DepthImage D>
  void compute(const D& depth, int min_valid = 5) {
    const int w = depth.width(), h = depth.height();
    nearest.resize(w, h);
    farthest.resize(w, h);
    for (int v = 0; v < h; ++v) {
      for (int u = 0; u < w; ++u) {
        S lo = std::numeric_limits<S>::max(), hi = S(0);
        int valid = 0;
        for (int dv = std::max(0, v - 1); dv <= std::min(h - 1, v + 1); ++dv) {
          for (int du = std::max(0, u - 1); du <= std::min(w - 1, u + 1); ++du) {
            const S z = static_cast<S>(depth(du, dv));
            if (!is_valid_depth(z)) continue;
            lo = std::min(lo, z);
            hi = std::max(hi, z);
            ++valid;
          }
        }
        const bool ok = valid >= min_valid;
        nearest(u, v) = ok ? lo : std::numeric_limits<S>::quiet_NaN();
        farthest(u, v) = ok ? hi : std::numeric_limits<S>::quiet_NaN();
      }
    }
  }
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

}  // namespace dynslam
