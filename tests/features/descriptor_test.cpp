// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/features/descriptor.hpp"

#include <doctest/doctest.h>

#include <bitset>

#include "random.hpp"

using namespace dynslam;

TEST_CASE("the distance of descriptors is the number of different bits") {
  test::Rng rng("hamming");
  for (int trial = 0; trial < 200; ++trial) {
    Descriptor a, b;
    int expected = 0;
    for (std::size_t w = 0; w < 4; ++w) {
      a[w] = rng.engine()();
      b[w] = trial == 0 ? ~a[w] : trial == 1 ? a[w] : rng.engine()();
      expected += static_cast<int>(std::bitset<64>(a[w] ^ b[w]).count());
    }
    CHECK(hamming_distance(a, b) == expected);
  }
}
