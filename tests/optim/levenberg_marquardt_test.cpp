// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/optim/levenberg_marquardt.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>

using namespace dynslam;

namespace {

/// Rosenbrock's valley (1 - x)^2 + 100 (y - x^2)^2, which undamped steps do not descend.
template <class S>
struct Valley {
  S x = S(-1.2), y = S(1);
  S a = S(0), b = S(0), c = S(0), gx = S(0), gy = S(0);  // J^T J = [a b; b c], J^T r
  S dx = S(0), dy = S(0), old_x = S(0), old_y = S(0);
  S forbidden = std::numeric_limits<S>::infinity();  // beyond this x the cost is infinite
  S tolerance = S(1e-12);
  int linearised = 0, refused = 0;
  bool solvable = true;

  [[nodiscard]] S cost() const {
    if (x > forbidden) return std::numeric_limits<S>::infinity();
    const S r = S(1) - x, q = S(10) * (y - x * x);
    return r * r + q * q;
  }
  void linearise() {
    ++linearised;
    const S r = S(1) - x, q = S(10) * (y - x * x), qx = S(-20) * x, qy = S(10);
    a = S(1) + qx * qx;
    b = qx * qy;
    c = qy * qy;
    gx = -r + qx * q;
    gy = qy * q;
  }
  bool solve(const S& lambda) {
    if (!solvable) return false;
    const S p = a * (S(1) + lambda), q = c * (S(1) + lambda), d = p * q - b * b;
    dx = (-gx * q + gy * b) / d;
    dy = (-gy * p + gx * b) / d;
    return std::isfinite(dx) && std::isfinite(dy);
  }
  S apply() {
    old_x = x;
    old_y = y;
    x += dx;
    y += dy;
    return cost();
  }
  S accept(const S& trial) { return trial; }
  void restore() {
    ++refused;
    x = old_x;
    y = old_y;
  }
  [[nodiscard]] bool converged(bool moved, const S& decrease, const S& now) const {
    return moved && decrease <= tolerance * now;
  }
};

static_assert(LeastSquaresProblem<Valley<float>, float> && LeastSquaresProblem<Valley<double>, double>);

}  // namespace

TEST_CASE_TEMPLATE("a curved valley is descended, uphill steps are taken back", S, float, double) {
  Valley<S> valley;
  const S start = valley.cost();
  LevenbergMarquardtOptions<S> options;
  options.max_iterations = 200;
  const auto result = levenberg_marquardt(valley, start, options);
  CHECK(result.status != LevenbergMarquardtStatus::max_iterations);
  CHECK(result.cost == valley.cost());
  CHECK(valley.x == doctest::Approx(1.0).epsilon(1e-3));
  CHECK(valley.y == doctest::Approx(1.0).epsilon(1e-3));
  CHECK(valley.refused > 0);
  CHECK(result.iterations <= valley.linearised + valley.refused);
}

TEST_CASE_TEMPLATE("a step to where the cost is infinite is refused; the last good place stays", S, float,
                   double) {
  Valley<S> valley;
  valley.forbidden = S(0.5);
  LevenbergMarquardtOptions<S> options;
  options.max_iterations = 500;
  options.max_damping = S(1e4);
  const auto result = levenberg_marquardt(valley, valley.cost(), options);
  CHECK(valley.x <= S(0.5));
  CHECK(std::isfinite(result.cost));
  CHECK(result.cost == valley.cost());
}

TEST_CASE_TEMPLATE("a system without solution stalls, or ends at once where that is asked", S, float,
                   double) {
  Valley<S> valley;
  valley.solvable = false;
  LevenbergMarquardtOptions<S> options;
  options.max_iterations = 100;
  auto result = levenberg_marquardt(valley, valley.cost(), options);
  CHECK(result.status == LevenbergMarquardtStatus::stalled);
  CHECK(result.iterations == 13);  // from 1e-4 beyond 1e8 by tens
  options.stop_unsolvable = true;
  result = levenberg_marquardt(valley, valley.cost(), options);
  CHECK(result.status == LevenbergMarquardtStatus::unsolvable);
  CHECK(result.iterations == 1);
  options.max_iterations = 0;
  result = levenberg_marquardt(valley, valley.cost(), options);
  CHECK(result.status == LevenbergMarquardtStatus::max_iterations);
  CHECK(result.iterations == 0);
}
