// SPDX-License-Identifier: BSD-3-Clause
// Weights and scale of the t-distribution over 4096 residuals (Eq 4); Huber's kernel beside it.
#include "dynslam/robust/t_distribution.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <vector>

#include <benchmark/benchmark.h>

#include "dynslam/robust/kernels.hpp"
#include "support/rng.hpp"

namespace {

constexpr int kResiduals = 4096;

// Sum of three uniforms is close to a normal distribution of standard deviation 1; one in ten is gross.
template <class S>
std::vector<S> residuals() {
  dynslam::bench::Random random(3);
  std::vector<S> out;
  for (int i = 0; i < kResiduals; ++i) {
    double r = random.uniform(-1, 1) + random.uniform(-1, 1) + random.uniform(-1, 1);
    if (i % 10 == 0) r *= 20.0;
    out.push_back(S(r));
  }
  return out;
}

template <class Kernel, class S>
void weigh(benchmark::State& state, const Kernel& kernel) {
  const std::vector<S> r = residuals<S>();
  std::vector<S> w(r.size());
  const auto run = [&] {
    for (std::size_t i = 0; i < r.size(); ++i) w[i] = kernel.weight(r[i] * r[i]);
  };
  run();
  // A weight falls with the size of the residual.
  const auto by_size = [](S a, S b) { return std::abs(a) < std::abs(b); };
  const auto largest = static_cast<std::size_t>(std::max_element(r.begin(), r.end(), by_size) - r.begin());
  if (!(w[largest] > S(0)) || w[largest] != *std::min_element(w.begin(), w.end())) {
    state.SkipWithError("the weights are wrong");
    return;
  }
  for (auto _ : state) {
    run();
    benchmark::DoNotOptimize(w.data());
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * kResiduals);
}

template <class S>
void weight_t_distribution(benchmark::State& state) {
  weigh<dynslam::TDistribution<S>, S>(state, dynslam::TDistribution<S>());
}
BENCHMARK_TEMPLATE(weight_t_distribution, float);
BENCHMARK_TEMPLATE(weight_t_distribution, double);

template <class S>
void weight_huber(benchmark::State& state) {
  weigh<dynslam::Huber<S>, S>(state, dynslam::Huber<S>());
}
BENCHMARK_TEMPLATE(weight_huber, float);
BENCHMARK_TEMPLATE(weight_huber, double);

}  // namespace

BENCHMARK_MAIN();
