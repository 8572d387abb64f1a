// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/geometry/epipolar_rows.hpp"

#include <doctest/doctest.h>

#include <vector>

#include "dynslam/geometry/epipolar.hpp"
#include "random.hpp"

using namespace dynslam;

TEST_CASE_TEMPLATE("distances of many matches are those of each one, also beyond whole blocks", S, float,
                   double) {
  test::Rng rng("epipolar rows");
  Eigen::Matrix<S, 3, 3> F;
  F << S(1e-7), S(-3e-6), S(1e-3), S(4e-6), S(2e-7), S(-6e-3), S(-2e-3), S(5e-3), S(0.4);
  for (const std::size_t n : {std::size_t{0}, std::size_t{1}, std::size_t{64}, std::size_t{131}}) {
    std::vector<S> x, y, x_m, y_m, line(n), sampson(n);
    for (auto* row : {&x, &y, &x_m, &y_m}) {
      for (std::size_t i = 0; i < n; ++i) row->push_back(S(rng.uniform(0, 480)));
    }
    const PixelRows<S> rows{x, y, x_m, y_m};
    line_distances<S>(F, rows, line);
    sampson_distances_squared<S>(F, rows, sampson);
    for (std::size_t i = 0; i < n; ++i) {
      const Eigen::Matrix<S, 2, 1> a(x[i], y[i]), b(x_m[i], y_m[i]);
      CHECK(line[i] == doctest::Approx(static_cast<double>(line_distance<S>(F, a, b))).epsilon(1e-4));
      CHECK(sampson[i] ==
            doctest::Approx(static_cast<double>(sampson_distance_squared<S>(F, a, b))).epsilon(1e-3));
    }
  }
}
