// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <benchmark/benchmark.h>

#include <string>
#include <type_traits>
#include <utility>

namespace dynslam::bench {

template <class S>
inline constexpr const char* kScalarName = std::is_same_v<S, float> ? "float" : "double";

/// Registers a benchmark under "family/case/scalar/who"; the table of docs/benchmarks.md compares whoever has
/// the rest in common.
/// @param f  f(benchmark::State&)
template <class F>
benchmark::internal::Benchmark* add(const std::string& what, const char* scalar, const std::string& who,
                                    F&& f, benchmark::TimeUnit unit = benchmark::kMicrosecond) {
  return benchmark::RegisterBenchmark((what + '/' + scalar + '/' + who).c_str(), std::forward<F>(f))
      ->Unit(unit);
}

}  // namespace dynslam::bench
