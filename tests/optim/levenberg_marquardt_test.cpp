// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/optim/levenberg_marquardt.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <optional>
#include <type_traits>

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

namespace {

template <class S>
struct ValleyOptions {
  int max_iterations = 300;
  S initial_damping = S(1e-4), min_damping = S(1e-9);
};
template <class S>
struct StiffValleyOptions : ValleyOptions<S> {
  S min_refused_damping = S(1e-5), max_damping = S(1e6);
};
enum class ValleyStatus { converged, max_iterations, stalled, too_small };
template <class S>
struct ValleyResult {
  ValleyStatus status = ValleyStatus::too_small;
  S initial_cost = S(0), final_cost = S(0);
  int iterations = 0;
};
/// The valley as an estimator has it.
template <class S>
struct PreparedValley : Valley<S> {
  std::optional<ValleyStatus> against;
  S at_start = S(0);
  [[nodiscard]] std::optional<ValleyStatus> prepare() const { return against; }
  [[nodiscard]] S start() const { return at_start; }
};

}  // namespace

TEST_CASE_TEMPLATE("the damping of an estimator's options is passed on, and defaults where it has none", S,
                   float, double) {
  const auto few = damping_of<S>(ValleyOptions<S>{});
  CHECK(few.max_iterations == 300);
  CHECK(few.initial_damping == S(1e-4));
  CHECK(few.min_damping == S(1e-9));
  CHECK(few.min_refused_damping == S(0));
  CHECK(few.max_damping == S(1e8));
  CHECK_FALSE(few.stop_unsolvable);
  const auto all = damping_of<S>(StiffValleyOptions<S>{});
  CHECK(all.min_refused_damping == S(1e-5));
  CHECK(all.max_damping == S(1e6));
}

TEST_CASE("a status with fewer names calls what stalled a limit of iterations") {
  enum class Short { converged, max_iterations };
  using Status = LevenbergMarquardtStatus;
  CHECK(status_of<ValleyStatus>(Status::converged) == ValleyStatus::converged);
  CHECK(status_of<ValleyStatus>(Status::stalled) == ValleyStatus::stalled);
  CHECK(status_of<ValleyStatus>(Status::max_iterations) == ValleyStatus::max_iterations);
  CHECK(status_of<Short>(Status::converged) == Short::converged);
  CHECK(status_of<Short>(Status::stalled) == Short::max_iterations);
}

TEST_CASE_TEMPLATE("an estimator tells what stands against its problem, a cost without end, or its minimum",
                   S, float, double) {
  PreparedValley<S> valley;
  valley.at_start = valley.cost();
  const ValleyOptions<S> options;
  const auto found = minimise<ValleyResult<S>, S>(valley, options);
  CHECK(found.status == ValleyStatus::converged);
  CHECK(found.initial_cost == valley.at_start);
  CHECK(found.final_cost == valley.cost());
  CHECK(found.final_cost < found.initial_cost);
  CHECK(found.iterations > 0);
  PreparedValley<S> refused;
  refused.against = ValleyStatus::stalled;
  CHECK(minimise<ValleyResult<S>, S>(refused, options).status == ValleyStatus::stalled);
  PreparedValley<S> endless;
  endless.at_start = std::numeric_limits<S>::infinity();
  const auto none = minimise<ValleyResult<S>, S>(endless, options);
  CHECK(none.status == ValleyStatus::too_small);
  CHECK(none.iterations == 0);
}
