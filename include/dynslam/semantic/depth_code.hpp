// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <bit>
#include <concepts>
#include <cstdint>

namespace dynslam {

/// A depth in 16 bits: the exponent and the upper 11 digits of a float, from 2^-12 m (a quarter of a
/// millimetre) to 2^20 m. Rounded by 2^-12 of the depth at most, 0.24 mm at 1 m, which is far below the noise
/// of any sensor that is no better at a distance than near.
struct DepthCode {
  std::uint16_t bits = 0;

  static constexpr float kLeast = 1.0F / (1U << 12U);                ///< [m]
  static constexpr float kMost = (1U << 20U) - (1U << (20U - 12U));  ///< [m]

  DepthCode() = default;
  constexpr explicit DepthCode(std::uint16_t stored) : bits(stored) {}
  /// @param z  above 0 [m]; depths below kLeast and above kMost become these
  template <std::floating_point S>
  [[nodiscard]] static constexpr DepthCode of(S z) {
    const auto within = static_cast<float>(std::clamp(z, S(kLeast), S(kMost)));
    const std::uint32_t digits = (std::bit_cast<std::uint32_t>(within) + (1U << (kDropped - 1))) >> kDropped;
    return DepthCode(static_cast<std::uint16_t>(digits - kFirst));
  }
  /// [m]
  [[nodiscard]] constexpr float metres() const { return std::bit_cast<float>((bits + kFirst) << kDropped); }

 private:
  static constexpr std::uint32_t kDropped = 12;  // digits of a float's 23
  static constexpr std::uint32_t kFirst = std::bit_cast<std::uint32_t>(kLeast) >> kDropped;
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
