// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <concepts>

#include "dynslam/dynamics/residuals.hpp"
#include "dynslam/robust/t_distribution.hpp"

namespace dynslam {

/// Diagonal of Sigma^(1/2) in Eq (7). The depth's grows with z^2: evaluate it at the point's depth.
template <std::floating_point S>
struct StaticWeightScales {
  S photometric;   ///< grey values
  S reprojection;  ///< pixels
  S depth;         ///< metres
};

/// E^T Sigma^-1 E of Eq (7); a missing error contributes nothing.
template <std::floating_point S>
[[nodiscard]] S squared_normalised(const KeypointResiduals<S>& e, const StaticWeightScales<S>& scales) {
  const auto square = [](S value, S sigma) { return value * value / (sigma * sigma); };
  S s = square(e.reprojection, scales.reprojection);
  if (e.has_photometric) s += square(e.photometric, scales.photometric);
  if (e.has_depth) s += square(e.depth, scales.depth);
  return s;
}

/// Eq (7): w = (nu + d) / (nu + E^T Sigma^-1 E), d being the number of errors that are there. The
/// paper prints nu + 1; with nu + d a typical static point has weight 1 whether or not its depth is
/// known, so that one threshold serves all.
template <std::floating_point S>
[[nodiscard]] S static_weight(const KeypointResiduals<S>& e, const StaticWeightScales<S>& scales, S nu) {
  return TDistribution<S>::with_dimension(nu, e.dimension()).weight(squared_normalised(e, scales));
}

/// Eq (7) with a given distribution, for the paper's own form: TDistribution<S>::paper().
template <std::floating_point S>
[[nodiscard]] S static_weight(const KeypointResiduals<S>& e, const StaticWeightScales<S>& scales,
                              const TDistribution<S>& distribution) {
  return distribution.weight(squared_normalised(e, scales));
}

}  // namespace dynslam
