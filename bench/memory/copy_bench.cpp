// SPDX-License-Identifier: BSD-3-Clause
// What memory gives: a copy of as many bytes as an image of floats, of a million voxels' log-odds and of what
// no cache holds. docs/benchmarks.md states bytes per second of memory-bound kernels beside these.
#include <benchmark/benchmark.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "support/named.hpp"

namespace {

using namespace dynslam;

void copy(benchmark::State& state, std::size_t bytes) {
  const std::vector<std::uint8_t> from(bytes, 7);
  std::vector<std::uint8_t> to(bytes);
  for (auto _ : state) {
    std::memcpy(to.data(), from.data(), bytes);
    benchmark::DoNotOptimize(to.data());
    benchmark::ClobberMemory();
  }
  if (to != from) state.SkipWithError("not copied");
  state.SetBytesProcessed(2 * state.iterations() * static_cast<std::int64_t>(bytes));  // read and written
}

const bool registered = [] {
  for (const int kilobytes : {1200, 8192, 131072}) {
    bench::add("copy/" + std::to_string(kilobytes) + "kB", "uint8", "memcpy",
               [=](benchmark::State& s) { copy(s, std::size_t(kilobytes) * 1024); });
  }
  return true;
}();

}  // namespace

BENCHMARK_MAIN();
