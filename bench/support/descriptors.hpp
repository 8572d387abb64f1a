// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "dynslam/features/descriptor.hpp"
#include "support/rng.hpp"

namespace dynslam::bench {

[[nodiscard]] inline std::vector<Descriptor> random_descriptors(Random& random, std::size_t count) {
  std::vector<Descriptor> out(count);
  for (Descriptor& d : out) {
    for (std::uint64_t& word : d) word = random.bits();
  }
  return out;
}

/// Another view of a corner: some bits differ.
[[nodiscard]] inline Descriptor seen_again(Random& random, Descriptor d, int bits) {
  for (int k = 0; k < bits; ++k) {
    const std::uint64_t bit = random.bits() % kDescriptorBits;
    d[bit / 64] ^= std::uint64_t(1) << (bit % 64);
  }
  return d;
}

}  // namespace dynslam::bench
