// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <array>
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

/// Options of FreeSpaceHistory.
struct FreeSpaceOptions {
  /// Ages of the views that the present one is compared with, ascending [s]: near ones follow what was found,
  /// far ones show slow motion. The remembered view nearest to each is used, once. One that is not older than
  /// the first only passes its mask on: in so short a time hardly anything moves by more than the noise.
  std::array<double, 7> lags{1 / 30.0, 4 / 30.0, 8 / 30.0, 0.5, 25 / 30.0, 40 / 30.0, 2.0};
  double old_lag = 8 / 30.0;    ///< a mover has left its own volume by then: what is still there supports [s]
  double rest_lag = 25 / 30.0;  ///< what has stayed for so long is at rest, even if it moved before [s]
  double follow_lag = 4 / 30.0;  ///< the last view, and those up to this age, pass their belief on [s]
  double memory = 0.7;           ///< time in which a belief without new evidence falls to 1/e of it [s]
  float prior = -2;              ///< log-odds that a surface moves of which nothing is known
  float unseen = 0.02F;          ///< confidence in that, beside 1 of a surface that was seen before
  float violated = 2.5F;         ///< log-likelihood ratio of a surface where the space was free, per view
  float supported = 0.5F;        ///< and against motion, of one that was there already, per view
  float bound = 4;               ///< of what all views together say
  float min_depth = 0.2F;        ///< nearer than this to an earlier camera nothing is judged [m]
  float max_depth = 5.0F;        ///< beyond, depth is too noisy to judge [m]
  FreeSpaceMargins<float> margins;
  /// By how much the time of a depth image may differ from that of its pose [s]: its rows are not taken at
  /// once (a rolling shutter), and stamps are not good to the millisecond. Half of it where the motion of the
  /// rows is given. A fifth of a frame at 30 Hz.
  double depth_time_uncertainty = 1 / 150.0;
  int max_shift = 4;  ///< of a depth image beside its pose, by that time and the camera's speed [cells]
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
