// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/geometry/small_cholesky.hpp"

#include <doctest/doctest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <type_traits>
#include <vector>

#include "dynslam/optim/normal_equations.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

/// A positive definite matrix whose parameters have units `decades` orders of magnitude apart; above its
/// diagonal stands nonsense.
template <class S, int N>
Eigen::Matrix<S, N, N> positive_definite(test::Rng& rng, double decades) {
  Eigen::MatrixXd J(N, N + 3);
  for (int j = 0; j < N + 3; ++j) {
    for (int i = 0; i < N; ++i) J(i, j) = rng.normal() * std::pow(10, decades * i / N);
  }
  const Eigen::MatrixXd JJ = J * J.transpose();
  Eigen::Matrix<S, N, N> A = JJ.template cast<S>();
  A.template triangularView<Eigen::StrictlyUpper>().setConstant(S(1e9));
  return A;
}

template <class S, int N>
void compare_with_eigen(test::Rng& rng) {
  const double tolerance = 1e5 * static_cast<double>(std::numeric_limits<S>::epsilon());
  for (const double decades : {0.0, 4.0}) {
    const auto A = positive_definite<S, N>(rng, decades);
    // Of dynamic size, so that Eigen's solvers are compiled once and not for every N.
    Eigen::MatrixXd whole = A.template cast<double>();
    whole = Eigen::MatrixXd(whole.selfadjointView<Eigen::Lower>());
    Eigen::Matrix<S, N, 1> b;
    for (int i = 0; i < N; ++i) b(i) = S(rng.normal());
    SmallCholesky<S, N> factor;
    REQUIRE(factor.compute(A));
    const Eigen::VectorXd expected = whole.llt().solve(Eigen::VectorXd(b.template cast<double>()));
    const Eigen::VectorXd solution = factor.solve(b).template cast<double>();
    CHECK(solution.isApprox(expected, tolerance));
    const auto inverse = factor.inverse();
    CHECK(inverse == inverse.transpose());
    CHECK(Eigen::MatrixXd(inverse.template cast<double>()).isApprox(whole.inverse(), tolerance));
  }
}

}  // namespace

TEST_CASE_TEMPLATE("solutions and inverses are those of Eigen's LLT, from the lower triangle alone", S, float,
                   double) {
  test::Rng rng("small cholesky");
  for (int k = 0; k < 20; ++k) {
    compare_with_eigen<S, 1>(rng);
    compare_with_eigen<S, 3>(rng);
    compare_with_eigen<S, 6>(rng);
    compare_with_eigen<S, 9>(rng);
  }
}

TEST_CASE_TEMPLATE("what is not positive definite by more than rounding is refused, whatever its units", S,
                   float, double) {
  using Matrix = Eigen::Matrix<S, 3, 3>;
  SmallCholesky<S, 3> factor;
  const S nan = std::numeric_limits<S>::quiet_NaN(), infinity = std::numeric_limits<S>::infinity();
  for (const S bad : {S(0), S(-1), nan, infinity}) {
    CAPTURE(bad);
    Matrix A = Matrix::Identity();
    A(1, 1) = bad;
    CHECK_FALSE(factor.compute(A));
  }
  Matrix off = Matrix::Identity();
  off(2, 0) = nan;
  CHECK_FALSE(factor.compute(off));
  off(2, 0) = S(1.5);  // no correlation is above 1
  CHECK_FALSE(factor.compute(off));
  // Two parameters of which only the sum matters, in units far apart.
  for (const S unit : {S(1e-6), S(1), S(1e6)}) {
    const Eigen::Matrix<S, 1, 3> row(unit, S(1) / unit, S(0));
    Matrix A = row.transpose() * row;
    A(2, 2) = S(1);
    CHECK_FALSE(factor.compute(A));
    A(0, 0) *= S(1.01);
    CHECK(factor.compute(A));
  }
}

TEST_CASE_TEMPLATE("what points on an axis leave free is refused, and what they determine is solved", S,
                   float, double) {
  // A pose from points at 1 to 5 m before the camera: all on the optical axis (a turn about it is free), on a
  // line across (turns about that line), on a plane, and with rows and columns of zeros.
  const auto system = [](const std::vector<Eigen::Vector3d>& points, bool depth) {
    NormalEquations<S, 6> sum;
    sum.set_zero();
    for (const Eigen::Vector3d& p : points) {
      Eigen::Matrix<double, 3, 6> J;
      J << 1 / p.z(), 0, -p.x() / (p.z() * p.z()), 0, 0, 0, 0, 1 / p.z(), -p.y() / (p.z() * p.z()), 0, 0, 0,
          0, 0, 1, 0, 0, 0;
      Eigen::Matrix3d cross;
      cross << 0, p.z(), -p.y(), -p.z(), 0, p.x(), p.y(), -p.x(), 0;
      J.rightCols<3>() = J.leftCols<3>() * cross;
      for (int r = 0; r < (depth ? 3 : 2); ++r) {
        const Eigen::Matrix<S, 1, 6> row = J.row(r).template cast<S>();
        sum.add_row(row, S(0.1), S(500 * 500));
      }
    }
    return sum;
  };
  const std::vector<Eigen::Vector3d> axis{{0, 0, 1}, {0, 0, 2}, {0, 0, 3}, {0, 0, 5}},
      line{{-1, 0, 2}, {0, 0, 2}, {1, 0, 2}, {2, 0, 2}},
      plane{{-1, -1, 2}, {1, -1, 2}, {-1, 1, 2}, {1, 1, 2}, {0, 1, 2}, {1, 0, 2}};
  Eigen::Matrix<S, 6, 1> step;
  Eigen::Matrix<S, 6, 6> covariance;
  for (const bool depth : {false, true}) {
    CHECK_FALSE(system(axis, depth).solve(S(0), step));
    CHECK_FALSE(system(axis, depth).covariance(covariance));
    CHECK_FALSE(system(line, depth).solve(S(0), step));
    REQUIRE(system(plane, depth).solve(S(0), step));
    const auto whole = system(plane, depth);
    const Eigen::Matrix<double, 6, 6> H = whole.hessian().template cast<double>();
    const Eigen::Matrix<double, 6, 1> expected =
        -H.fullPivLu().solve(whole.gradient().template cast<double>());
    CHECK((step.template cast<double>() - expected).norm() <
          (std::is_same_v<S, float> ? 5e-2 : 1e-8) * expected.norm());
  }
}
