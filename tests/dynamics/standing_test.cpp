// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/dynamics/standing.hpp"

#include <doctest/doctest.h>

#include <cstdint>

#include "dynslam/image/image.hpp"

using namespace dynslam;

TEST_CASE("what is static is marked block by block, but for what moves") {
  // 23 x 10 pixels: the last blocks are cut off at the border.
  Image<std::uint8_t> moving(23, 10, 0), still(23, 10, 7);
  moving(5, 5) = 1;
  int asked = 0;
  const auto verified = [&](int u, int v) {
    ++asked;
    CHECK((u < 23 && v < 10));
    return u >= 4 && v >= 4;
  };
  mark_standing(moving, verified, 4, still);
  CHECK(asked == 6 * 3);
  for (int v = 0; v < 10; ++v) {
    for (int u = 0; u < 23; ++u) {
      CAPTURE(u);
      CAPTURE(v);
      CHECK(still(u, v) == (u >= 4 && v >= 4 && !(u == 5 && v == 5) ? 255 : 7));
    }
  }
}
