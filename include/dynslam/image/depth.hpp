// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <concepts>
#include <limits>
#include <type_traits>

#include "dynslam/concepts/image.hpp"
#include "dynslam/config.hpp"
#include "dynslam/image/image_row.hpp"

namespace dynslam {

/// The one validity rule for depth: finite and positive [m].
template <std::floating_point S>
[[nodiscard]] constexpr bool is_valid_depth(S z) {
  return z > S(0) && z <= std::numeric_limits<S>::max();
}

/// Raw sensor units to metres: out = raw / units_per_metre, 0 becomes NaN. Calculated in S; both images need
/// the same size (asserted).
/// @param raw  any image of integers
/// @param units_per_metre  5000 for TUM fr1 and fr3, 5208 for fr2
template <std::floating_point S, LabelImage Raw, OutputDepthImage Out>
void depth_to_metres(const Raw& raw, S units_per_metre, Out&& out) {
  using Depth = typename std::remove_reference_t<Out>::Pixel;
  DYNSLAM_ASSERT(same_size(raw, out), "both images need the same size");
  const S scale = S(1) / units_per_metre;
  for (int v = 0; v < raw.height(); ++v) {
    const auto from = image_row(raw, v);
    auto to = image_row(out, v);
    for (int u = 0; u < raw.width(); ++u) {
      to[u] = static_cast<Depth>(from[u] == 0 ? std::numeric_limits<S>::quiet_NaN()
                                              : static_cast<S>(from[u]) * scale);
    }
  }
}

/// Standard deviation of structured-light depth: sigma(z) = base + quad * z^2 [m], from the constant
/// disparity error of the sensor (Khoshelham and Elberink 2012).
template <std::floating_point S>
struct DepthNoise {
  S base = S(0.001);
  S quad = S(0.0019);
  [[nodiscard]] constexpr S sigma(S z) const { return base + quad * z * z; }
  /// Inverse variance [1/m^2].
  [[nodiscard]] constexpr S information(S z) const { return S(1) / (sigma(z) * sigma(z)); }
};

}  // namespace dynslam
