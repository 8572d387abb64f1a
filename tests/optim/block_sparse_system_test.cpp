// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/optim/block_sparse_system.hpp"

#include <doctest/doctest.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "random.hpp"

using namespace dynslam;

namespace {

constexpr int kBlockSize = 3;

/// A chain of n blocks with as many links across.
std::vector<std::array<int, 2>> chain_with_links(int n, int links, test::Rng& random) {
  std::vector<std::array<int, 2>> pairs;
  for (int k = 1; k < n; ++k) pairs.push_back({k - 1, k});
  for (int k = 0; k < links && n > 2; ++k) {
    const int a = static_cast<int>(random.uniform(0, n - 0.01)),
              b = static_cast<int>(random.uniform(0, n - 0.01));
    if (a != b) pairs.push_back({a, b});
  }
  return pairs;
}

/// J^T J of differences over the pairs, and of the blocks themselves: positive definite. The same, dense.
template <class S>
Eigen::MatrixXd fill(BlockSparseSystem<S, kBlockSize>& system, const std::vector<std::array<int, 2>>& pairs,
                     double anchor, test::Rng& random) {
  const int n = system.size();
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(kBlockSize * n, kBlockSize * n);
  const auto add = [&](int row, int column, const Eigen::Matrix3d& block) {
    dense.block<kBlockSize, kBlockSize>(kBlockSize * row, kBlockSize * column) += block;
    if (row < column) return;
    auto& to = system.block(row == column ? system.diagonal(row) : system.place(row, column));
    for (std::size_t k = 0; k < to.size(); ++k) to[k] += static_cast<S>(block.data()[k]);
  };
  const auto matrix = [&] {
    Eigen::Matrix3d out;
    for (int k = 0; k < 9; ++k) out.data()[k] = random.uniform(-1, 1);
    return out;
  };
  system.set_zero();
  for (int k = 0; k < n; ++k) add(k, k, anchor * Eigen::Matrix3d::Identity());
  for (const auto& [a, b] : pairs) {
    const Eigen::Matrix3d A = matrix(), B = matrix();
    add(a, a, A.transpose() * A);
    add(b, b, B.transpose() * B);
    add(a, b, A.transpose() * B);
    add(b, a, B.transpose() * A);
  }
  return dense;
}

}  // namespace

TEST_CASE_TEMPLATE("the solution of a sparse system of blocks equals a dense solver's", S, float, double) {
  test::Rng random("block sparse system");
  BlockSparseSystem<S, kBlockSize> system;  // the same one: nothing of the last may stay
  for (const int n : {1, 2, 5, 60, 17}) {
    CAPTURE(n);
    auto pairs = chain_with_links(n, n / 2, random);
    system.reset(n, pairs);
    REQUIRE(system.size() == n);
    for (int round = 0; round < 2; ++round) {
      const Eigen::MatrixXd dense = fill(system, pairs, 0.5, random);
      Eigen::VectorXd right(kBlockSize * n);
      for (int k = 0; k < right.size(); ++k) right(k) = random.uniform(-1, 1);
      std::vector<S> x(static_cast<std::size_t>(right.size()));
      const auto solve = [&] {
        for (std::size_t k = 0; k < x.size(); ++k) x[k] = static_cast<S>(right(static_cast<Eigen::Index>(k)));
        REQUIRE(system.factor());
        system.solve(x);
      };
      solve();
      const Eigen::VectorXd expected = dense.ldlt().solve(right);
      const double tolerance = (std::is_same_v<S, float> ? 1e-4 : 1e-11) * expected.norm();
      double error = 0;
      for (std::size_t k = 0; k < x.size(); ++k)
        error = std::max(error, std::abs(static_cast<double>(x[k]) - expected(static_cast<Eigen::Index>(k))));
      CHECK(error < tolerance);
      const auto first = x;
      solve();  // the matrix is as it was
      CHECK(x == first);
    }
  }
}

TEST_CASE_TEMPLATE("blocks without a neighbour, and a graph in pieces, are solved", S, float, double) {
  test::Rng random("pieces");
  const std::vector<std::array<int, 2>> pairs{{3, 1}, {1, 3}, {5, 6}};
  BlockSparseSystem<S, kBlockSize> system;
  system.reset(8, pairs);
  const Eigen::MatrixXd dense = fill(system, pairs, 1, random);
  std::vector<S> x(24, S(1));
  REQUIRE(system.factor());
  system.solve(x);
  const Eigen::VectorXd expected = dense.ldlt().solve(Eigen::VectorXd::Ones(24));
  for (std::size_t k = 0; k < x.size(); ++k)
    CHECK(static_cast<double>(x[k]) == doctest::Approx(expected(static_cast<Eigen::Index>(k))).epsilon(1e-4));
}

TEST_CASE_TEMPLATE("a sparse system that is not positive definite is refused", S, float, double) {
  test::Rng random("refused");
  const std::vector<std::array<int, 2>> pairs{{0, 1}, {1, 2}};
  BlockSparseSystem<S, kBlockSize> system;
  system.reset(3, pairs);
  CHECK_FALSE(system.factor());  // zero
  (void)fill(system, pairs, 1, random);
  REQUIRE(system.factor());
  auto& last = system.block(system.diagonal(2));
  const S kept = last[8];
  for (const S bad : {S(-1), S(0), std::numeric_limits<S>::quiet_NaN(), std::numeric_limits<S>::infinity()}) {
    CAPTURE(bad);
    last[8] = bad;
    CHECK_FALSE(system.factor());
  }
  last[8] = kept;
  CHECK(system.factor());
}
