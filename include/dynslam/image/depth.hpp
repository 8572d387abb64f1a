// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cmath>
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
  // Both are asked without a branch, so that loops over pixels may be of vectors.
  const bool positive = z > S(0), finite = z <= std::numeric_limits<S>::max();
  return positive & finite;
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
      // Added, which changes nothing else: compilers make a branch of a choice between the two.
      const S invalid = from[u] == 0 ? std::numeric_limits<S>::quiet_NaN() : S(0);
      to[u] = static_cast<Depth>(static_cast<S>(from[u]) * scale + invalid);
    }
  }
}

/// Standard deviation of depth, sigma(z) = base + linear z + quad z^2 [m]. What sensors have by the way they
/// measure is made by structured_light(), stereo() and time_of_flight(); by default a Kinect's.
template <std::floating_point S>
struct DepthNoise {
  S base = S(0.001);   ///< [m]
  S quad = S(0.0019);  ///< [1/m]
  S linear = S(0);

  /// base + quad z^2, from the constant disparity error of the sensor (Khoshelham and Elberink 2012).
  [[nodiscard]] static constexpr DepthNoise structured_light(S base, S quad) { return {base, quad, S(0)}; }
  /// base + z^2 disparity / (focal baseline): z = focal baseline / d, derived by the disparity d.
  /// @param baseline   between the two imagers [m]
  /// @param focal      of the depth images [px]
  /// @param disparity  its standard deviation [px]
  /// @param base       of what does not come from matching, the depth's step for one [m]
  [[nodiscard]] static constexpr DepthNoise stereo(S baseline, S focal, S disparity, S base = S(0.001)) {
    return {base, disparity / (focal * baseline), S(0)};
  }
  /// base + linear z: the received light, and with it the phase's certainty, fades with the distance.
  [[nodiscard]] static constexpr DepthNoise time_of_flight(S base, S linear) { return {base, S(0), linear}; }

  /// The same sensor with so many times the noise.
  [[nodiscard]] constexpr DepthNoise times(S factor) const {
    return {factor * base, factor * quad, factor * linear};
  }
  template <std::floating_point T>
  [[nodiscard]] constexpr DepthNoise<T> cast() const {
    return {static_cast<T>(base), static_cast<T>(quad), static_cast<T>(linear)};
  }
  [[nodiscard]] constexpr bool operator==(const DepthNoise&) const = default;
  [[nodiscard]] constexpr S sigma(S z) const { return base + linear * z + quad * z * z; }
  /// Largest depth whose sigma is `sigma` at most [m]; 0 where even the nearest has more, infinite where all
  /// have less.
  [[nodiscard]] S range(S sigma) const {
    const S above = sigma - base;
    if (!(above > S(0))) return S(0);
    const S slope = linear + std::sqrt(linear * linear + S(4) * quad * above);
    return slope > S(0) ? S(2) * above / slope : std::numeric_limits<S>::infinity();
  }
  /// Inverse variance [1/m^2].
  [[nodiscard]] constexpr S information(S z) const { return S(1) / (sigma(z) * sigma(z)); }
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
