// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <limits>

namespace dynslam {

/// The damping of Levenberg-Marquardt, (H + lambda diag H) step = -b.
template <std::floating_point S>
struct LevenbergMarquardtOptions {
  int max_iterations = 10;       ///< solved systems, refused steps included
  S initial_damping = S(1e-4);   ///< lambda of the first step
  S min_damping = S(1e-10);      ///< lambda does not fall below: it must be able to rise again in few steps
  S min_refused_damping = S(0);  ///< after a refused step lambda is at least this
  S max_damping = S(1e8);        ///< beyond, the steps are too short to change anything: stalled
  S decrease = S(0.1);           ///< factor of lambda after an accepted step
  S increase = S(10);            ///< and after a refused one
  bool stop_unsolvable = false;  ///< a system without solution ends the iteration; otherwise it counts as a
                                 ///< refused step, since more damping may make it solvable
};

/// How levenberg_marquardt ended.
enum class LevenbergMarquardtStatus : std::uint8_t {
  converged,
  max_iterations,  ///< still decreasing
  stalled,         ///< no damping gave a decrease
  unsolvable       ///< the system has no solution (with stop_unsolvable)
};

/// What levenberg_marquardt reached.
template <std::floating_point S>
struct LevenbergMarquardtResult {
  LevenbergMarquardtStatus status = LevenbergMarquardtStatus::max_iterations;
  S cost = S(0);
  int iterations = 0;
};

/// What is minimised. `apply` makes the step that `solve` found and gives the cost there, infinity or NaN
/// where the step is not allowed; then either `accept` or `restore` is called.
template <class P, class S>
concept LeastSquaresProblem = requires(P& problem, const S& value, bool accepted) {
  problem.linearise();                                                  // at the present parameters
  { problem.solve(value) } -> std::same_as<bool>;                       // by lambda
  { problem.apply() } -> std::same_as<S>;                               // trial cost
  { problem.accept(value) } -> std::same_as<S>;                         // trial cost -> cost from now on
  problem.restore();                                                    // takes the step back
  { problem.converged(accepted, value, value) } -> std::same_as<bool>;  // step taken?, decrease, cost
};

/// Minimises by Levenberg-Marquardt: a step that does not raise the cost is accepted and the damping lowered,
/// any other is taken back and the damping raised. Allocates nothing itself.
/// @param cost  at the start, finite
template <std::floating_point S, LeastSquaresProblem<S> Problem>
LevenbergMarquardtResult<S> levenberg_marquardt(Problem& problem, S cost,
                                                const LevenbergMarquardtOptions<S>& options) {
  using Status = LevenbergMarquardtStatus;
  LevenbergMarquardtResult<S> result;
  S lambda = options.initial_damping;
  bool moved = true;
  while (result.iterations < options.max_iterations && result.status == Status::max_iterations) {
    if (moved) problem.linearise();
    moved = false;
    ++result.iterations;
    if (problem.solve(lambda)) {
      const S trial = problem.apply();
      moved = trial <= cost;
      S decrease = S(0);
      if (moved) {
        decrease = cost - trial;
        cost = problem.accept(trial);
        lambda = std::max(lambda * options.decrease, options.min_damping);
      } else {
        problem.restore();
      }
      if (problem.converged(moved, decrease, cost)) result.status = Status::converged;
    } else if (options.stop_unsolvable) {
      result.status = Status::unsolvable;
    }
    if (!moved && result.status == Status::max_iterations) {
      lambda = std::max(lambda * options.increase, options.min_refused_damping);
      if (lambda > options.max_damping) result.status = Status::stalled;
    }
  }
  result.cost = cost;
  return result;
}

/// The damping in the options of an estimator, whose fields bear the names of LevenbergMarquardtOptions;
/// where one is missing its default holds.
template <std::floating_point S, class Options>
[[nodiscard]] LevenbergMarquardtOptions<S> damping_of(const Options& options) {
  LevenbergMarquardtOptions<S> damping;
  damping.max_iterations = options.max_iterations;
  damping.initial_damping = options.initial_damping;
  damping.min_damping = options.min_damping;
  if constexpr (requires { options.min_refused_damping; })
    damping.min_refused_damping = options.min_refused_damping;
  if constexpr (requires { options.max_damping; }) damping.max_damping = options.max_damping;
  return damping;
}

/// How a minimisation ended as the status of an estimator, whose enumerators bear the same names. Without
/// `stalled` among them it counts as max_iterations.
template <class Status>
[[nodiscard]] constexpr Status status_of(LevenbergMarquardtStatus minimum) {
  if (minimum == LevenbergMarquardtStatus::converged) return Status::converged;
  if constexpr (requires { Status::stalled; }) {
    if (minimum == LevenbergMarquardtStatus::stalled) return Status::stalled;
  }
  return Status::max_iterations;
}

/// An estimator from start to end: what stands against the problem (`prepare`, which answers with a status or
/// nothing), its cost at the start, the minimum.
/// @tparam Result  has status, initial_cost, final_cost and iterations; as it is by default where the cost at
///                 the start is not finite
template <class Result, std::floating_point S, class Problem, class Options>
  requires LeastSquaresProblem<Problem, S>
[[nodiscard]] Result minimise(Problem& problem, const Options& options) {
  Result result;
  if (const auto refused = problem.prepare()) {
    result.status = *refused;
    return result;
  }
  result.initial_cost = result.final_cost = problem.start();
  if (!std::isfinite(result.initial_cost)) return result;
  const auto minimum = levenberg_marquardt(problem, result.initial_cost, damping_of<S>(options));
  result.final_cost = minimum.cost;
  result.iterations = minimum.iterations;
  result.status = status_of<decltype(result.status)>(minimum.status);
  return result;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
