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
  weigh<dynslam::TDistribution<S>, S>(state, dynslam::TDistribution<S>::with_dimension(S(5), 1));
}
BENCHMARK_TEMPLATE(weight_t_distribution, float)->Name("robust/t_distribution_4096/float/dynslam");
BENCHMARK_TEMPLATE(weight_t_distribution, double)->Name("robust/t_distribution_4096/double/dynslam");

template <class S>
void weight_huber(benchmark::State& state) {
  weigh<dynslam::Huber<S>, S>(state, dynslam::Huber<S>());
}
BENCHMARK_TEMPLATE(weight_huber, float)->Name("robust/huber_4096/float/dynslam");
BENCHMARK_TEMPLATE(weight_huber, double)->Name("robust/huber_4096/double/dynslam");

/// Kerl's fixed point as one writes it, from the median absolute deviation on, gross residuals left out.
double plain_scale(const std::vector<double>& r) {
  std::vector<double> a;
  for (const double x : r) a.push_back(std::abs(x));
  std::vector<double> sorted = a;
  std::sort(sorted.begin(), sorted.end());
  double sigma = 1.4826 * sorted[sorted.size() / 2];
  const double limit = 6 * sigma;
  for (int i = 0; i < 50; ++i) {
    double sum = 0;
    int n = 0;
    for (const double x : a) {
      if (x > limit) continue;
      sum += 6 / (5 + x * x / (sigma * sigma)) * x * x;
      ++n;
    }
    const double next = std::sqrt(sum / n);
    const bool done = std::abs(next - sigma) <= 1e-4 * sigma;
    sigma = next;
    if (done) break;
  }
  return sigma;
}

template <class S>
void scale(benchmark::State& state) {
  const std::vector<S> r = residuals<S>();
  dynslam::ScaleWorkspace<S> workspace;
  const dynslam::ScaleOptions<S> options;
  const auto find = [&] { return dynslam::estimate_scale<S>(std::span<const S>(r), {}, options, workspace); };
  const auto found = find();
  if (!found || std::abs(static_cast<double>(*found) - plain_scale(residuals<double>())) > 1e-3) {
    state.SkipWithError("the scale is wrong");
    return;
  }
  for (auto _ : state) {
    auto sigma = find();
    benchmark::DoNotOptimize(sigma);
  }
  state.SetItemsProcessed(state.iterations() * kResiduals);
}
BENCHMARK_TEMPLATE(scale, float)->Name("robust/scale_4096/float/dynslam");
BENCHMARK_TEMPLATE(scale, double)->Name("robust/scale_4096/double/dynslam");

void scale_as_written(benchmark::State& state) {
  const std::vector<double> r = residuals<double>();
  for (auto _ : state) {
    double sigma = plain_scale(r);
    benchmark::DoNotOptimize(sigma);
  }
  state.SetItemsProcessed(state.iterations() * kResiduals);
}
BENCHMARK(scale_as_written)->Name("robust/scale_4096/double/scalar");

}  // namespace

BENCHMARK_MAIN();
