// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <concepts>
#include <cstddef>
#include <cstdint>

namespace dynslam {

/// Random numbers for samples, the same on every platform; the standard library's distributions differ
/// between implementations. (SplitMix64, Steele et al. 2014.)
class SplitMix64 {
 public:
  explicit SplitMix64(std::uint64_t seed) : state_(seed) {}
  [[nodiscard]] std::uint64_t next() {
    std::uint64_t z = (state_ += 0x9E3779B97F4A7C15ULL);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
    return z ^ (z >> 31);
  }
  /// Integer in [0, n) from the upper half of the bits.
  [[nodiscard]] int below(int n) {
    return static_cast<int>((next() >> 32) * static_cast<std::uint64_t>(n) >> 32);
  }
  /// Index in [0, n).
  [[nodiscard]] std::size_t index(std::size_t n) { return static_cast<std::size_t>(next() % n); }
  /// Uniform in [0, 1).
  template <std::floating_point S>
  [[nodiscard]] S unit() {
    return S(next() >> 11) * S(0x1p-53);
  }

 private:
  std::uint64_t state_;
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
