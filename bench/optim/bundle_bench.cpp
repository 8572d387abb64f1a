// SPDX-License-Identifier: BSD-3-Clause
// Adjustment of a window of 10 keyframes and 2000 points (the gauge included), until the cost falls by less
// than a millionth, beside Ceres with the same residuals, loss and criterion. The final cost may be no more
// than a thousandth (Ceres' own spread) above that of the minimum.
#include <vector>

#ifdef DYNSLAM_BENCH_CERES
#include "baselines/bundle_ceres.hpp"
#endif
#include "dynslam/optim/bundle_adjustment.hpp"
#include "dynslam/robust/t_distribution.hpp"
#include "support/named.hpp"
#include "support/window.hpp"

namespace {

using namespace dynslam;

constexpr double kTolerance = 1e-6;
constexpr const char* kWhat = "bundle/10x2000";

/// Of the minimum, by many iterations in double.
double least_cost() {
  static const double cost = [] {
    auto window = bench::make_window<double>(10, 2000);
    BundleOptions<double> options;
    options.max_iterations = 200;
    options.tolerance = 1e-12;
    BundleWorkspace<double> workspace;
    return bundle_adjust<double>(bench::camera<double>(), window.problem(), options,
                                 TDistribution<double>::with_dimension(5, 1), workspace)
        .final_cost;
  }();
  return cost;
}

template <class Solve>
void time_bundle(benchmark::State& state, const Solve& solve) {
  const double cost = solve();
  state.counters["cost_above_least"] = cost / least_cost() - 1;
  if (!(cost < least_cost() * 1.001)) {
    state.SkipWithError("not the minimum");
    return;
  }
  for (auto _ : state) benchmark::DoNotOptimize(solve());
}

template <class S>
void ours(benchmark::State& state) {
  const auto start = bench::make_window<S>(10, 2000);
  auto window = start;
  BundleOptions<S> options;
  options.max_iterations = 100;
  options.tolerance = S(kTolerance);
  BundleWorkspace<S> workspace;
  state.counters["observations"] = static_cast<double>(start.observations.size());
  int iterations = 0;
  time_bundle(state, [&] {
    window.poses = start.poses;
    window.points = start.points;
    const auto result = bundle_adjust<S>(bench::camera<S>(), window.problem(), options,
                                         TDistribution<S>::with_dimension(S(5), 1), workspace);
    iterations = result.iterations;
    return static_cast<double>(result.final_cost);
  });
  state.counters["iterations"] = iterations;
}

#ifdef DYNSLAM_BENCH_CERES
void ceres_schur(benchmark::State& state, ceres::LinearSolverType solver) {
  auto window = bench::make_window<double>(10, 2000);
  time_bundle(state, [&] {
    return baselines::ceres_bundle(bench::camera<double>(), window.problem(), solver, kTolerance);
  });
}
#endif

const bool registered = [] {
  constexpr auto kUnit = benchmark::kMillisecond;
  bench::add(
      kWhat, "double", "dynslam", [](benchmark::State& s) { ours<double>(s); }, kUnit);
  bench::add(
      kWhat, "float", "dynslam", [](benchmark::State& s) { ours<float>(s); }, kUnit);
#ifdef DYNSLAM_BENCH_CERES
  bench::add(
      kWhat, "double", "ceres_dense_schur", [](benchmark::State& s) { ceres_schur(s, ceres::DENSE_SCHUR); },
      kUnit);
  bench::add(
      kWhat, "double", "ceres_sparse_schur", [](benchmark::State& s) { ceres_schur(s, ceres::SPARSE_SCHUR); },
      kUnit);
#endif
  return true;
}();

}  // namespace

BENCHMARK_MAIN();
