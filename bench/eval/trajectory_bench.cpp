// SPDX-License-Identifier: BSD-3-Clause
// Absolute and relative error of 2000 poses at 30 Hz against a ground truth at 100 Hz, beside TUM's scripts,
// line by line in C++ (which ask all pairs of stamps). The absolute error is the same number.
#include <benchmark/benchmark.h>

#include <cmath>
#include <span>
#include <vector>

#include "baselines/tum_evaluation.hpp"
#include "dynslam/eval/trajectory.hpp"
#include "support/named.hpp"
#include "support/rng.hpp"

namespace {

using namespace dynslam;

template <class S>
struct Trajectories {
  std::vector<StampedPose<S>> truth, estimate;
};

template <class S>
Trajectories<S> make() {
  bench::Random random(31);
  const auto at = [](double t) {
    return SE3d(SO3d::exp(Eigen::Vector3d(0.2 * std::sin(t), 0.1 * t, 0.1 * std::cos(2 * t))),
                Eigen::Vector3d(std::sin(t), 0.3 * std::cos(3 * t), 0.1 * t));
  };
  Trajectories<S> out;
  for (int k = 0; k < 6667; ++k) out.truth.push_back({1000 + 0.01 * k, at(0.01 * k).template cast<S>(), 0});
  for (int k = 0; k < 2000; ++k) {
    const double t = k / 30.0 + random.uniform(-0.002, 0.002);
    Eigen::Matrix<double, 6, 1> noise;
    for (int i = 0; i < 6; ++i) noise(i) = 0.01 * random.normal();
    out.estimate.push_back({1000 + t, (at(t) * SE3d::exp(noise)).template cast<S>(), 0});
  }
  return out;
}

template <class S, class Evaluate>
void time_evaluation(benchmark::State& state, double least, double most, const Evaluate& evaluate) {
  const auto in = make<S>();
  const auto run = [&] {
    return evaluate(std::span<const StampedPose<S>>(in.estimate), std::span<const StampedPose<S>>(in.truth));
  };
  const auto error = static_cast<double>(run());
  state.counters["error"] = error;
  if (!(error > least && error < most)) {
    state.SkipWithError("the error is wrong");
    return;
  }
  for (auto _ : state) benchmark::DoNotOptimize(run());
  state.SetItemsProcessed(state.iterations() * 2000);
}

template <class S>
void register_scalar() {
  const char* name = bench::kScalarName<S>;
  bench::add("trajectory/ate_2000", name, "dynslam", [](benchmark::State& s) {
    time_evaluation<S>(s, 0.0165, 0.0185, [](const auto& estimate, const auto& truth) {
      return absolute_trajectory_error<S>(estimate, truth)->translation.rmse;
    });
  });
  bench::add("trajectory/rpe_2000", name, "dynslam", [](benchmark::State& s) {
    time_evaluation<S>(s, 0.01, 0.05, [](const auto& estimate, const auto& truth) {
      return relative_pose_error<S>(estimate, truth)->translation.rmse;
    });
  });
}

const bool registered = [] {
  register_scalar<double>();
  register_scalar<float>();
  bench::add("trajectory/ate_2000", "double", "tum_rules", [](benchmark::State& s) {
    time_evaluation<double>(s, 0.0165, 0.0185, [](const auto& estimate, const auto& truth) {
      return baselines::tum_ate(estimate, truth, 0.02);
    });
  });
  return true;
}();

}  // namespace

BENCHMARK_MAIN();
