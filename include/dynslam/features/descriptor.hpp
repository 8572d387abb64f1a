// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

namespace dynslam {

/// 256-bit binary descriptor (ORB, BRIEF); bit i is bit i % 64 of word i / 64.
using Descriptor = std::array<std::uint64_t, 4>;

/// Bits of a Descriptor.
inline constexpr int kDescriptorBits = 256;

/// Hamming distance of two descriptors, 0..256.
[[nodiscard]] inline int hamming_distance(const Descriptor& a, const Descriptor& b) {
#if defined(__POPCNT__) || defined(__aarch64__)
  int distance = 0;
  for (std::size_t i = 0; i < a.size(); ++i) distance += std::popcount(a[i] ^ b[i]);
  return distance;
#else
  // Without the instruction std::popcount is a function call per word. Counting in parallel within all four
  // words, which are added as soon as their counts fit, takes a third of the time.
  constexpr std::uint64_t k1 = 0x5555555555555555U, k2 = 0x3333333333333333U, k4 = 0x0F0F0F0F0F0F0F0FU,
                          k8 = 0x00FF00FF00FF00FFU;
  const auto by_four = [](std::uint64_t x) {  // counts of 4 bits each, at most 4
    x -= (x >> 1) & k1;
    return (x & k2) + ((x >> 2) & k2);
  };
  const auto by_eight = [](std::uint64_t x) { return (x & k4) + ((x >> 4) & k4); };
  std::uint64_t n = by_eight(by_four(a[0] ^ b[0]) + by_four(a[1] ^ b[1])) +
                    by_eight(by_four(a[2] ^ b[2]) + by_four(a[3] ^ b[3]));  // at most 32 in each byte
  n = (n & k8) + ((n >> 8) & k8);
  return static_cast<int>((n * 0x0001000100010001U) >> 48);
#endif
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
