// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/robust/block_jackknife.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "random.hpp"

using namespace dynslam;

TEST_CASE("Student's quantiles are the tables'") {
  CHECK(detail::t_quantile_975(5) == doctest::Approx(2.571).epsilon(0.005));
  CHECK(detail::t_quantile_975(11) == doctest::Approx(2.201).epsilon(0.001));
  CHECK(detail::t_quantile_975(23) == doctest::Approx(2.069).epsilon(0.001));
}

TEST_CASE_TEMPLATE("the jackknife's interval of a mean holds 95 % of correlated series, too", S, float,
                   double) {
  test::Rng random("block jackknife");
  for (const double memory : {0.0, 0.6}) {  // of the series from one value to the next
    int covered = 0;
    double width = 0;
    for (int trial = 0; trial < 400; ++trial) {
      std::vector<S> series;
      double value = random.normal(0, 1) / std::sqrt(1 - memory * memory);
      for (int n = 0; n < 100; ++n) {
        series.push_back(static_cast<S>(value));
        value = memory * value + random.normal(0, 1);
      }
      const auto mean = [&](std::size_t first, std::size_t end) {
        S sum = S(0), count = S(0);
        for (std::size_t i = 0; i < series.size(); ++i) {
          if (i >= first && i < end) continue;
          sum += series[i];
          count += S(1);
        }
        return sum / count;
      };
      const S half = block_jackknife<S>(series.size(), mean);
      covered += std::abs(mean(0, 0)) <= half ? 1 : 0;
      width += static_cast<double>(half) / 400;
    }
    CAPTURE(memory);
    CHECK(covered >= 372);
    CHECK(covered < 400);
    const double exact = 1.96 * 0.1 / (1 - memory);  // of long series
    CHECK(width > 0.95 * exact);
    CHECK(width < 1.6 * exact);
  }
}

TEST_CASE("a series that is too short, or needs every part, has no interval") {
  const double infinite = std::numeric_limits<double>::infinity();
  CHECK(block_jackknife<double>(5, [](std::size_t, std::size_t) { return 1.0; }) == infinite);
  CHECK(block_jackknife<double>(6, [](std::size_t, std::size_t) { return 1.0; }) < 1e-12);
  CHECK(block_jackknife<double>(
            12, [](std::size_t first, std::size_t) { return first == 0 ? std::nan("") : 1.0; }) == infinite);
}
