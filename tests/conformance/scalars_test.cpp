// SPDX-License-Identifier: BSD-3-Clause
#include "scalars.hpp"

#include <unsupported/Eigen/AutoDiff>

using namespace dynslam;

TEST_CASE("motions, errors, weights and two views agree in float and double") {
  test::check_float<test::OtherFunctions>();
}

TEST_CASE("motions, errors, weights and two views carry the derivatives of Eigen::AutoDiffScalar") {
  using Dual = Eigen::AutoDiffScalar<Eigen::Matrix<double, 6, 1>>;
  test::check_dual_numbers<test::OtherFunctions, Dual>(
      [](int k) { return Dual(0.0, 6, k); }, [](const Dual& x, int k) { return x.derivatives()(k); });
}
