// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>

#include "dynslam/concepts/image.hpp"
#include "dynslam/config.hpp"
#include "dynslam/features/feature.hpp"

namespace dynslam {

/// Flags the features that lie on a mask: those whose nearest pixel, as recorded, is nonzero. Other flags
/// stay as they are; what lies outside the mask's image is not flagged.
/// @param flags  one per feature; set to 1
template <LabelImage Mask>
void flag_masked(const Mask& mask, std::span<const Feature> features, std::span<std::uint8_t> flags) {
  DYNSLAM_ASSERT(features.size() == flags.size(), "every feature has one flag");
  for (std::size_t i = 0; i < features.size(); ++i) {
    const int u = static_cast<int>(std::lrint(features[i].u)),
              v = static_cast<int>(std::lrint(features[i].v));
    if (u < 0 || v < 0 || u >= mask.width() || v >= mask.height()) continue;
    if (mask(u, v) != 0) flags[i] = 1;
  }
}

/// Features with depth outside the flags.
[[nodiscard]] inline int unmasked_with_depth(std::span<const Feature> features,
                                             std::span<const std::uint8_t> flags) {
  DYNSLAM_ASSERT(features.size() == flags.size(), "every feature has one flag");
  int count = 0;
  for (std::size_t i = 0; i < features.size(); ++i) count += flags[i] == 0 && features[i].depth > 0 ? 1 : 0;
  return count;
}

/// Share of the features that flags leave; 1 where there are none.
template <std::floating_point S>
[[nodiscard]] S unmasked_share(std::span<const std::uint8_t> flags) {
  if (flags.empty()) return S(1);
  return static_cast<S>(std::count(flags.begin(), flags.end(), 0)) / static_cast<S>(flags.size());
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
