// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include "dynslam/concepts/scalar.hpp"
#include "dynslam/dynamics/residuals.hpp"
#include "dynslam/robust/t_distribution.hpp"

namespace dynslam {

/// Diagonal of Sigma^(1/2) in Eq (7). The depth's grows with z^2: evaluate it at the point's depth.
template <Scalar S>
struct StaticWeightScales {
  S photometric;   ///< grey values
  S reprojection;  ///< pixels
  S depth;         ///< metres
};

/// E^T Sigma^-1 E of Eq (7); a missing error contributes nothing.
template <Scalar S>
[[nodiscard]] S squared_normalised(const KeypointResiduals<S>& e, const StaticWeightScales<S>& scales) {
  const auto square = [](const S& value, const S& sigma) {  // of the quotient: squares of either may vanish
    const S ratio = value / sigma;
    return S(ratio * ratio);
  };
  S s = square(e.reprojection, scales.reprojection);
  if (e.photometric) s += square(*e.photometric, scales.photometric);
  if (e.depth) s += square(*e.depth, scales.depth);
  return s;
}

/// Eq (7): w = (nu + d) / (nu + E^T Sigma^-1 E), d being the number of errors that are there. The
/// paper prints nu + 1; with nu + d a typical static point has weight 1 whether or not its depth is
/// known, so that one threshold serves all.
template <Scalar S>
[[nodiscard]] S static_weight(const KeypointResiduals<S>& e, const StaticWeightScales<S>& scales,
                              const S& nu) {
  return TDistribution<S>::with_dimension(nu, e.dimension()).weight(squared_normalised(e, scales));
}

/// Eq (7) with a given distribution, for the paper's own form: TDistribution<S>::paper().
template <Scalar S>
[[nodiscard]] S static_weight(const KeypointResiduals<S>& e, const StaticWeightScales<S>& scales,
                              const TDistribution<S>& distribution) {
  return distribution.weight(squared_normalised(e, scales));
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
