// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/geometry/detail/first_root.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <type_traits>

#include "random.hpp"

using namespace dynslam;

TEST_CASE_TEMPLATE("the first root of a polynomial is found in all orders of its roots", S, float, double) {
  const double tolerance = std::is_same_v<S, float> ? 1e-2 : 1e-6;  // by the rounding of the coefficients
  test::Rng rng("first root");
  for (int k = 0; k < 500; ++k) {
    // (1 - t / a) (1 - t / b) (1 - t / c), some of the roots negative.
    std::array<double, 3> roots{};
    double first = std::numeric_limits<double>::infinity();
    for (double& r : roots) {
      r = rng.uniform(0.05, 20) * (rng.chance(0.3) ? -1 : 1);
      if (r > 0) first = std::min(first, r);
    }
    std::array<double, 4> c{1, 0, 0, 0};
    for (const double r : roots) {
      for (std::size_t i = 4; i-- > 1;) c[i] -= c[i - 1] / r;
    }
    for (double& x : c) x = static_cast<double>(static_cast<S>(x));  // a lens has them as S
    const double found = detail::first_root(c, 100.0);
    if (std::isfinite(first)) {
      CHECK(found == doctest::Approx(first).epsilon(tolerance));
    } else {
      CHECK(!std::isfinite(found));
    }
  }
  CHECK(!std::isfinite(detail::first_root(std::array{1.0, 0.0, 0.0}, 10.0)));
  CHECK(!std::isfinite(detail::first_root(std::array{1.0, -0.01, 0.0}, 10.0)));  // beyond the limit
  CHECK(detail::first_root(std::array{1.0, -1.5, 0.0, 0.0}, 1e4) == doctest::Approx(2.0 / 3));
}
