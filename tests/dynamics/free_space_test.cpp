// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/dynamics/free_space.hpp"
#include "dynslam/image/depth_bounds.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "random.hpp"

using namespace dynslam;

TEST_CASE_TEMPLATE("depth bounds equal a brute-force search of each neighbourhood", S, float, double) {
  test::Rng rng("depth bounds");
  Image<S> depth(17, 11);
  for (int v = 0; v < depth.height(); ++v) {
    for (int u = 0; u < depth.width(); ++u) {
      depth(u, v) = rng.uniform(0, 1) < 0.4 ? std::numeric_limits<S>::quiet_NaN() : S(rng.uniform(0.5, 4));
    }
  }
  DepthBounds<S> bounds;
  int invalid = 0;
  for (const int radius : {1, 0, 4, 20}) {  // the last reaches beyond both borders
    CAPTURE(radius);
    const int min_valid = radius == 0 ? 1 : 5;
    bounds.compute(depth.view(), min_valid, radius);
    for (int v = 0; v < depth.height(); ++v) {
      for (int u = 0; u < depth.width(); ++u) {
        S lo = S(100), hi = S(0);
        int valid = 0;
        for (int y = v - radius; y <= v + radius; ++y) {
          for (int x = u - radius; x <= u + radius; ++x) {
            if (x < 0 || y < 0 || x >= 17 || y >= 11 || !is_valid_depth(depth(x, y))) continue;
            valid += std::abs(x - u) <= 1 && std::abs(y - v) <= 1 ? 1 : 0;
            lo = std::min(lo, depth(x, y));
            hi = std::max(hi, depth(x, y));
          }
        }
        CAPTURE(u);
        CAPTURE(v);
        if (valid >= min_valid) {
          CHECK(bounds.nearest(u, v) == lo);
          CHECK(bounds.farthest(u, v) == hi);
        } else {
          ++invalid;
          CHECK(std::isnan(bounds.nearest(u, v)));
          CHECK(std::isnan(bounds.farthest(u, v)));
        }
      }
    }
  }
  CHECK(invalid > 0);
}

TEST_CASE_TEMPLATE("a point in formerly free space contradicts the view; one behind the surface does not", S,
                   float, double) {
  const FreeSpaceMargins<S> margins;
  const S wall = S(3);
  CHECK(free_space_evidence(S(1.5), wall, wall, margins) == DepthEvidence::violation);
  CHECK(free_space_evidence(wall, wall, wall, margins) == DepthEvidence::consistent);
  CHECK(free_space_evidence(S(4), wall, wall, margins) == DepthEvidence::unknown);
  CHECK(free_space_evidence(S(1.5), std::numeric_limits<S>::quiet_NaN(), std::numeric_limits<S>::quiet_NaN(),
                            margins) == DepthEvidence::unknown);
  // Between the two surfaces of a depth edge the pixel may belong to either.
  CHECK(free_space_evidence(S(2), S(1.5), wall, margins) == DepthEvidence::consistent);
}

TEST_CASE_TEMPLATE("the margins grow with depth as the sensor's noise does", S, float, double) {
  const FreeSpaceMargins<S> margins;
  const S gap = S(0.15);
  CHECK(free_space_evidence(S(1) - gap, S(1), S(1), margins) == DepthEvidence::violation);
  CHECK(free_space_evidence(S(5) - gap, S(5), S(5), margins) == DepthEvidence::consistent);
}
