// SPDX-License-Identifier: BSD-3-Clause
// Distances of matches to their epipolar lines, and Sampson's. Of four million matches beside a copy of as
// many bytes: what the memory allows. A thousand lie in the first cache, where a copy takes a tenth of what a
// division and a root per match take by themselves: beside those.
#include <benchmark/benchmark.h>

#include <cmath>
#include <cstring>
#include <span>
#include <vector>

#include "dynslam/geometry/epipolar.hpp"
#include "dynslam/geometry/epipolar_rows.hpp"
#include "support/rng.hpp"

namespace {

using namespace dynslam;

enum class Distance { line, sampson };

template <class S>
struct Rows {
  std::vector<S> values[4], out;
  Eigen::Matrix<S, 3, 3> F;
  explicit Rows(std::size_t n) : out(n) {
    bench::Random random(5);
    for (auto& row : values) {
      for (std::size_t i = 0; i < n; ++i) row.push_back(S(random.uniform(0, 480)));
    }
    F << S(1e-7), S(-3e-6), S(1e-3), S(4e-6), S(2e-7), S(-6e-3), S(-2e-3), S(5e-3), S(0.4);
  }
  [[nodiscard]] PixelRows<S> pixels() const { return {values[0], values[1], values[2], values[3]}; }
};

template <class S, int N, Distance which>
void ours(benchmark::State& state) {
  Rows<S> rows(N);
  const auto run = [&] {
    if constexpr (which == Distance::line) {
      line_distances<S>(rows.F, rows.pixels(), std::span<S>(rows.out));
    } else {
      sampson_distances_squared<S>(rows.F, rows.pixels(), std::span<S>(rows.out));
    }
  };
  run();
  for (std::size_t i = 0; i < N; i += 7) {
    const Eigen::Matrix<double, 2, 1> x(rows.values[0][i], rows.values[1][i]),
        x_m(rows.values[2][i], rows.values[3][i]);
    const Eigen::Matrix3d F = rows.F.template cast<double>();
    const double d = which == Distance::line ? line_distance<double>(F, x, x_m)
                                             : sampson_distance_squared<double>(F, x, x_m);
    if (std::abs(d - double(rows.out[i])) > (std::is_same_v<S, float> ? 1e-3 : 1e-9) * (1 + d)) {
      state.SkipWithError("a distance is wrong");
      return;
    }
  }
  for (auto _ : state) {
    run();
    benchmark::DoNotOptimize(rows.out.data());
    benchmark::ClobberMemory();
  }
  state.SetBytesProcessed(state.iterations() * N * 5 * static_cast<int>(sizeof(S)));
}

/// One after another, as the function for one match is called.
template <class S, int N, Distance which>
void one_by_one(benchmark::State& state) {
  Rows<S> rows(N);
  for (auto _ : state) {
    for (std::size_t i = 0; i < N; ++i) {
      const Eigen::Matrix<S, 2, 1> x(rows.values[0][i], rows.values[1][i]),
          x_m(rows.values[2][i], rows.values[3][i]);
      rows.out[i] = which == Distance::line ? line_distance<S>(rows.F, x, x_m)
                                            : sampson_distance_squared<S>(rows.F, x, x_m);
    }
    benchmark::DoNotOptimize(rows.out.data());
    benchmark::ClobberMemory();
  }
  state.SetBytesProcessed(state.iterations() * N * 5 * static_cast<int>(sizeof(S)));
}

/// Moves as many bytes, read and written ones together.
template <class S, int N>
void copy(benchmark::State& state) {
  const std::size_t half = N * 5 * sizeof(S) / 2;
  std::vector<unsigned char> from(half, 1), to(half);
  for (auto _ : state) {
    std::memcpy(to.data(), from.data(), half);
    benchmark::DoNotOptimize(to.data());
    benchmark::ClobberMemory();
  }
  state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(2 * half));
}

/// What no distance to a line can do without: a division and a root for each match, of numbers in the cache.
template <class S, int N>
void divide_and_root(benchmark::State& state) {
  Rows<S> rows(N);
  const auto above = Eigen::Map<const Eigen::Array<S, N, 1>>(rows.values[0].data()),
             below = Eigen::Map<const Eigen::Array<S, N, 1>>(rows.values[1].data());
  for (auto _ : state) {
    Eigen::Map<Eigen::Array<S, N, 1>>(rows.out.data()) = above / below.sqrt();
    benchmark::DoNotOptimize(rows.out.data());
    benchmark::ClobberMemory();
  }
}

#define DYNSLAM_DISTANCE(which, N, size, S, scalar, rival, who)                                             \
  BENCHMARK(ours<S, N, Distance::which>)->Name("epipolar/" #which "_distance_" size "/" scalar "/dynslam"); \
  BENCHMARK(one_by_one<S, N, Distance::which>)                                                              \
      ->Name("epipolar/" #which "_distance_" size "/" scalar "/scalar");                                    \
  BENCHMARK(rival<S, N>)->Name("epipolar/" #which "_distance_" size "/" scalar "/" who)
DYNSLAM_DISTANCE(line, 1000, "1000", float, "float", divide_and_root, "division_and_root");
DYNSLAM_DISTANCE(line, 1000, "1000", double, "double", divide_and_root, "division_and_root");
DYNSLAM_DISTANCE(line, 4'000'000, "4M", float, "float", copy, "copy");
DYNSLAM_DISTANCE(line, 4'000'000, "4M", double, "double", copy, "copy");
DYNSLAM_DISTANCE(sampson, 4'000'000, "4M", float, "float", copy, "copy");
DYNSLAM_DISTANCE(sampson, 4'000'000, "4M", double, "double", copy, "copy");

}  // namespace

BENCHMARK_MAIN();
