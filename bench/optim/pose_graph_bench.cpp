// SPDX-License-Identifier: BSD-3-Clause
// A loop of 1000 keyframes: a way around a circle with noise and drift, edges to the last two keyframes and,
// as often as a place is seen again, 50 across; beside Ceres with the same information matrices. Both answers
// are compared by dynslam's cost.
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#ifdef DYNSLAM_BENCH_CERES
#include "baselines/pose_graph_ceres.hpp"
#endif
#include "dynslam/optim/pose_graph.hpp"
#include "support/named.hpp"
#include "support/rng.hpp"

namespace {

using namespace dynslam;

constexpr int kKeyframes = 1000;
constexpr double kTolerance = 1e-8;

template <class S>
struct Loop {
  std::vector<SE3<S>> poses;
  std::vector<std::uint8_t> fixed = std::vector<std::uint8_t>(kKeyframes, 0);
  std::vector<PoseGraphEdge<S>> edges;
  [[nodiscard]] PoseGraph<S> graph() { return {poses, fixed, edges}; }
};

/// Twice around, so that the second round sees the places of the first.
template <class S>
Loop<S> make_loop() {
  using Vector6 = SE3d::Vector6;
  bench::Random random(5);
  std::vector<SE3d> truth;
  for (int k = 0; k < kKeyframes; ++k) {
    const double a = 4 * std::numbers::pi * k / kKeyframes;
    const SE3d T_w_c(SO3d::exp(Eigen::Vector3d(0, -a, 0)),
                     Eigen::Vector3d(10 * std::cos(a), 0.2 * std::sin(3 * a), 10 * std::sin(a)));
    truth.push_back(T_w_c.inverse());
  }
  Loop<S> loop;
  const auto add = [&](int i, int j) {
    Vector6 noise;
    for (int c = 0; c < 6; ++c) noise(c) = random.normal() * (c < 3 ? 0.003 : 0.001);
    PoseGraphEdge<S> e;
    e.i = i;
    e.j = j;
    const auto at = [&](int k) { return truth[static_cast<std::size_t>(k)]; };
    const SE3d T_j_i = SE3d::exp(noise) * at(j) * at(i).inverse();
    e.T_j_i = T_j_i.template cast<S>();
    Eigen::Matrix<double, 6, 6> A;
    for (int c = 0; c < 36; ++c) A(c / 6, c % 6) = random.normal();
    const Eigen::Matrix<double, 6, 6> information =
        1e4 * (Eigen::Matrix<double, 6, 6>::Identity() + 0.02 * A * A.transpose());
    e.information = information.template cast<S>();
    loop.edges.push_back(e);
    return T_j_i;
  };
  loop.fixed[0] = 1;
  SE3d T = truth[0];
  loop.poses.push_back(T.template cast<S>());
  for (int k = 1; k < kKeyframes; ++k) {
    T = add(k - 1, k) * T;
    loop.poses.push_back(T.template cast<S>());
    if (k > 1) add(k - 2, k);
    if (k >= kKeyframes / 2 && k % 10 == 0) add(k - kKeyframes / 2, k);
  }
  return loop;
}

double cost_of(const std::vector<SE3d>& poses) {
  static const auto loop = make_loop<double>();
  double sum = 0;
  for (const auto& e : loop.edges) {
    const auto r =
        pose_graph_residual<double>(poses[static_cast<std::size_t>(e.i)],
                                    poses[static_cast<std::size_t>(e.j)], e.T_j_i, nullptr, nullptr);
    sum += r.dot(e.information * r);
  }
  return sum;
}

/// Of the minimum, by many iterations.
double least_cost() {
  static const double cost = [] {
    auto loop = make_loop<double>();
    PoseGraphOptions<double> options;
    options.tolerance = 1e-14;
    (void)optimize_pose_graph<double>(loop.graph(), options);
    return cost_of(loop.poses);
  }();
  return cost;
}

/// @param solve  the poses, in the end in double @param allowed  cost above the least one
template <class Solve>
void time_graph(benchmark::State& state, double allowed, const Solve& solve) {
  std::vector<SE3d> poses;
  for (const auto& T : solve()) poses.push_back(T.template cast<double>());
  const double above = cost_of(poses) / least_cost() - 1;
  state.counters["cost_above_least"] = above;
  if (!(above < allowed)) {
    state.SkipWithError("not the minimum");
    return;
  }
  for (auto _ : state) {
    const auto& answer = solve();
    benchmark::DoNotOptimize(answer.data());
  }
}

/// @param allowed  float has seven digits for poses of ten metres
template <class S>
void ours(benchmark::State& state, double allowed) {
  const auto start = make_loop<S>();
  auto loop = start;
  PoseGraphOptions<S> options;
  options.tolerance = S(kTolerance);
  PoseGraphWorkspace<S> workspace;
  time_graph(state, allowed, [&]() -> const std::vector<SE3<S>>& {
    loop.poses = start.poses;
    const auto result = optimize_pose_graph<S>(loop.graph(), options, SquaredLoss<S>(), workspace);
    state.counters["iterations"] = result.iterations;
    return loop.poses;
  });
}

#ifdef DYNSLAM_BENCH_CERES
void ceres_sparse(benchmark::State& state) {
  auto loop = make_loop<double>();
  time_graph(state, 1e-3, [&] { return baselines::ceres_pose_graph(loop.graph(), kTolerance); });
}
#endif

const bool registered = [] {
  constexpr auto kUnit = benchmark::kMillisecond;
  bench::add(
      "pose_graph/1000", "double", "dynslam", [](benchmark::State& s) { ours<double>(s, 1e-3); }, kUnit);
  bench::add(
      "pose_graph/1000", "float", "dynslam", [](benchmark::State& s) { ours<float>(s, 0.2); }, kUnit);
#ifdef DYNSLAM_BENCH_CERES
  bench::add(
      "pose_graph/1000", "double", "ceres", [](benchmark::State& s) { ceres_sparse(s); }, kUnit);
#endif
  return true;
}();

}  // namespace

BENCHMARK_MAIN();
