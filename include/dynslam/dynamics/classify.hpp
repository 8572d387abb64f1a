// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>

#include "dynslam/config.hpp"

namespace dynslam {

/// A keypoint is dynamic when its static weight is below tau (paper, Eq 7). NaN counts as dynamic:
/// what cannot be judged must not be trusted.
template <std::floating_point S>
[[nodiscard]] constexpr bool is_dynamic(S weight, S tau) {
  return !(weight >= tau);
}

/// Flags of all keypoints (1 = dynamic); returns how many are. Both spans have the same size.
template <std::floating_point S>
std::size_t classify(std::span<const S> weights, S tau, std::span<std::uint8_t> dynamic) {
  DYNSLAM_ASSERT(weights.size() == dynamic.size(), "one flag per weight");
  std::size_t count = 0;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    dynamic[i] = is_dynamic(weights[i], tau) ? 1 : 0;
    count += dynamic[i];
  }
  return count;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
