// SPDX-License-Identifier: BSD-3-Clause
// The update of a million voxels by a scan that hits one in eight (Eq 12), beside OctoMap's update of as many
// nodes and the recursion on probabilities (Eq 9), which gives the same probability between the bounds.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#ifdef DYNSLAM_BENCH_OCTOMAP
#include <octomap/OcTree.h>
#endif
#include "dynslam/semantic/log_odds.hpp"
#include "support/named.hpp"
#include "support/rng.hpp"

namespace {

using namespace dynslam;

constexpr std::size_t kVoxels = 1 << 20;
constexpr const char* kWhat = "log_odds/update_1M";

const std::vector<std::uint8_t>& hits() {
  static const std::vector<std::uint8_t> flags = [] {
    bench::Random random(3);
    std::vector<std::uint8_t> out(kVoxels);
    for (auto& flag : out) flag = random.bits() % 8 == 0 ? 1 : 0;
    return out;
  }();
  return flags;
}

/// What a miss and a hit say; looked up, so that no branch is to be foretold.
template <class S>
struct Measurements {
  S of[2];
};

/// @param update  update(i, hit): hit is 0 or 1 @param log_odds  log_odds(i) -> double
template <class Update, class LogOdds>
void time_update(benchmark::State& state, const Update& update, const LogOdds& log_odds) {
  const std::uint8_t* const flags = hits().data();
  for (std::size_t i = 0; i < kVoxels; ++i) update(i, flags[i]);
  for (std::size_t i = 0; i < kVoxels; i += 1000) {
    const double expected = probability_to_log_odds(hits()[i] != 0 ? 0.7 : 0.4);
    if (!(std::abs(log_odds(i) - expected) < 1e-5)) {
      state.SkipWithError("the log-odds are wrong");
      return;
    }
  }
  for (auto _ : state) {
    for (std::size_t i = 0; i < kVoxels; ++i) update(i, flags[i]);
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(kVoxels));
}

template <class S>
void ours(benchmark::State& state) {
  std::vector<LogOddsCell<S>> cells(kVoxels);
  const LogOddsParams<S> params;
  const Measurements<S> log_odds{params.miss, params.hit};
  time_update(
      state, [&](std::size_t i, std::size_t hit) { cells[i].update(log_odds.of[hit], params); },
      [&](std::size_t i) { return static_cast<double>(cells[i].log_odds()); });
  state.SetBytesProcessed(state.iterations() *
                          static_cast<std::int64_t>(kVoxels * (2 * sizeof(cells[0]) + 1)));
}

template <class S>
void by_probability(benchmark::State& state) {
  std::vector<S> p(kVoxels, S(0.5));
  const Measurements<S> probability{S(0.4), S(0.7)};
  time_update(
      state,
      [&](std::size_t i, std::size_t hit) {
        p[i] = std::clamp(bayes_update(probability.of[hit], p[i], S(0.5)), S(0.12), S(0.97));
      },
      [&](std::size_t i) { return std::log(static_cast<double>(p[i]) / (1 - static_cast<double>(p[i]))); });
}

#ifdef DYNSLAM_BENCH_OCTOMAP
void octomap_nodes(benchmark::State& state) {
  std::vector<octomap::OcTreeNode> nodes(kVoxels);
  const octomap::OcTree tree(0.1);
  const Measurements<float> log_odds{tree.getProbMissLog(), tree.getProbHitLog()};
  time_update(
      state, [&](std::size_t i, std::size_t hit) { tree.updateNodeLogOdds(&nodes[i], log_odds.of[hit]); },
      [&](std::size_t i) { return static_cast<double>(nodes[i].getLogOdds()); });
}
#endif

const bool registered = [] {
  bench::add(kWhat, "float", "dynslam", ours<float>);
  bench::add(kWhat, "double", "dynslam", ours<double>);
  bench::add(kWhat, "float", "probabilities", by_probability<float>);
  bench::add(kWhat, "double", "probabilities", by_probability<double>);
#ifdef DYNSLAM_BENCH_OCTOMAP
  bench::add(kWhat, "float", "octomap", octomap_nodes);
#endif
  return true;
}();

}  // namespace

BENCHMARK_MAIN();
