// SPDX-License-Identifier: BSD-3-Clause
// Shares of valid depth against a count of all pixels.
#include "dynslam/segment/valid_depth_share.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <limits>

#include "dynslam/image/image.hpp"
#include "random.hpp"

namespace {

using namespace dynslam;

TEST_CASE_TEMPLATE("a share of the valid depth is that of a count of all pixels, in any order of questions",
                   S, float, double) {
  test::Rng rng("valid depth share");
  for (int trial = 0; trial < 40; ++trial) {
    const int w = rng.integer(1, 90), h = rng.integer(1, 50);
    Image<S> depth(w, h);
    std::size_t valid = 0;
    const double holes = trial % 4 == 0 ? 1 : rng.uniform(0, 1);  // all of them now and then
    for (int v = 0; v < h; ++v) {
      for (int u = 0; u < w; ++u) {
        depth(u, v) = rng.chance(holes) ? S(0) : S(3);
        if (rng.chance(0.1)) depth(u, v) = std::numeric_limits<S>::quiet_NaN();
        if (depth(u, v) > S(0)) ++valid;
      }
    }
    ValidDepthShare share(depth);
    for (int i = 0; i < 30; ++i) {
      const double fraction = i % 7 == 0 ? rng.uniform(-0.2, 1.2) : 0.1 * rng.integer(0, 9);
      auto pixels = static_cast<std::size_t>(rng.integer(0, w * h));
      if (i % 3 == 0 && fraction > 0)  // at the limit
        pixels = static_cast<std::size_t>(fraction * static_cast<double>(valid)) + (i % 2 == 0 ? 1 : 0);
      const bool more = fraction < 1 && static_cast<double>(pixels) >
                                            (fraction > 0 ? fraction * static_cast<double>(valid) : 0.0);
      CHECK(share.exceeded_by(pixels, fraction) == more);
    }
  }
}

}  // namespace
