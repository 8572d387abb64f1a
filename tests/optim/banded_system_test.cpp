// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/optim/banded_system.hpp"

#include <doctest/doctest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "random.hpp"

using namespace dynslam;

TEST_CASE_TEMPLATE("solution and inverse diagonal of a banded system equal a dense solver's", S, float,
                   double) {
  test::Rng random("banded system");
  for (const std::size_t n :
       {std::size_t{1}, std::size_t{2}, std::size_t{3}, std::size_t{4}, std::size_t{9}, std::size_t{60}}) {
    CAPTURE(n);
    BandedSystem<S, 3> banded;
    banded.reset(n);
    CHECK(banded.size() == n);
    const auto size = static_cast<Eigen::Index>(n);
    Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(size, size);
    Eigen::VectorXd right(size);
    for (std::size_t i = 0; i < n; ++i) {
      const auto at = static_cast<Eigen::Index>(i);
      right(at) = random.uniform(-1, 1);
      for (std::size_t k = 0; k <= 3 && i + k < n; ++k) {
        const double value = k == 0 ? random.uniform(4, 6) : random.uniform(-1, 1);
        banded.at(i, k) = static_cast<S>(value);
        dense(at + static_cast<Eigen::Index>(k), at) = dense(at, at + static_cast<Eigen::Index>(k)) = value;
      }
    }
    REQUIRE(banded.factor());
    std::vector<S> x(n), diagonal(n);
    for (std::size_t i = 0; i < n; ++i) x[i] = static_cast<S>(right(static_cast<Eigen::Index>(i)));
    banded.solve(x);
    banded.inverse_diagonal(diagonal);
    const Eigen::VectorXd expected = dense.llt().solve(right);
    const Eigen::MatrixXd inverse = dense.inverse();
    for (std::size_t i = 0; i < n; ++i) {
      const auto at = static_cast<Eigen::Index>(i);
      CHECK(static_cast<double>(x[i]) == doctest::Approx(expected(at)).epsilon(1e-5));
      CHECK(static_cast<double>(diagonal[i]) == doctest::Approx(inverse(at, at)).epsilon(1e-5));
    }
  }
}

TEST_CASE_TEMPLATE("a matrix that is not positive definite is refused", S, float, double) {
  BandedSystem<S, 3> banded;
  banded.reset(2);
  banded.at(0, 0) = S(1);
  banded.at(0, 1) = S(2);
  banded.at(1, 0) = S(1);
  CHECK_FALSE(banded.factor());
  banded.reset(3);
  CHECK_FALSE(banded.factor());
}

TEST_CASE_TEMPLATE("a chain that nothing holds in place is refused, whatever rounding leaves of its pivots",
                   S, float, double) {
  // Fault: a pivot of 1e-17 counted as positive, and the solution was noise.
  test::Rng random("loose chain");
  int refused = 0, held = 0;
  for (int trial = 0; trial < 50; ++trial) {
    BandedSystem<S, 3> banded;
    const auto differences = [&](double anchor) {  // of first order, of weights that are no binary fractions
      test::Rng weights("weights" + std::to_string(trial));
      banded.reset(40);
      banded.at(0, 0) = static_cast<S>(anchor);
      for (std::size_t i = 0; i + 1 < 40; ++i) {
        const auto w = static_cast<S>(weights.uniform(0.1, 3));
        banded.at(i, 0) += w;
        banded.at(i + 1, 0) += w;
        banded.at(i, 1) -= w;
      }
    };
    differences(0);
    refused += banded.factor() ? 0 : 1;
    differences(1);
    held += banded.factor() ? 1 : 0;
    for (const S bad : {std::numeric_limits<S>::quiet_NaN(), std::numeric_limits<S>::infinity()}) {
      for (const std::size_t k : {std::size_t{0}, std::size_t{1}}) {
        differences(1);
        banded.at(7, k) = bad;
        CHECK_FALSE(banded.factor());
      }
    }
  }
  CHECK(refused >= 45);  // rounding may hold a chain of 40 by a little more than 10 epsilon
  CHECK(held == 50);
}
