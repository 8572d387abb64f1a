// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/dynamics/standing.hpp"

#include <doctest/doctest.h>

#include <cstdint>
#include <vector>

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

TEST_CASE("of an object most of which is static the rest is, but for what moves") {
  // Objects 1 and 900 side by side, and none below; of 1 three columns of four were verified, of 900 one.
  Image<std::uint16_t> objects(8, 4, 0);
  Image<float> depth(8, 4, 2.0F);
  Image<std::uint8_t> moving(8, 4, 0), still(8, 4, 0);
  for (int v = 0; v < 3; ++v) {
    for (int u = 0; u < 8; ++u) objects(u, v) = u < 4 ? 1 : 900;
    for (const int u : {0, 1, 2, 4}) still(u, v) = 255;
  }
  moving(3, 1) = 255;
  std::vector<StandingCount> counts;
  SUBCASE("by what was measured") {
    mark_standing_objects(objects, depth, moving, still, counts);
    for (int v = 0; v < 4; ++v) {
      for (int u = 0; u < 8; ++u) {
        CAPTURE(u);
        CAPTURE(v);
        CHECK((still(u, v) != 0) == (v < 3 && u <= 4 && !(u == 3 && v == 1)));
      }
    }
  }
  SUBCASE("what has no depth is neither static nor not") {
    for (int v = 0; v < 3; ++v) depth(5, v) = depth(6, v) = depth(7, v) = 0;
    mark_standing_objects(objects, depth, moving, still, counts);
    for (int u = 4; u < 8; ++u) CHECK(still(u, 1) == 255);
  }
  SUBCASE("half is not most") {
    for (int v = 0; v < 3; ++v) still(5, v) = 255;
    mark_standing_objects(objects, depth, moving, still, counts);
    CHECK(still(6, 1) == 0);
  }
}
