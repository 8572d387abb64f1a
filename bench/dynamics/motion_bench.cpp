// SPDX-License-Identifier: BSD-3-Clause
// A frame's work: static_weights of its matches, and MotionSegmenter as a whole, over 20 rendered frames of
// 640 x 480 with a board that is carried through a room. Nothing else computes the same; the times are for
// comparing versions.
#include <benchmark/benchmark.h>

#include <vector>

#include "dynslam/dynamics/motion_segmenter.hpp"
#include "dynslam/dynamics/static_weights.hpp"
#include "moving_scene.hpp"
#include "support/rng.hpp"
#include "support/scene.hpp"

namespace {

using namespace dynslam;

constexpr int kFrames = 20, kMatches = 1000;

struct Frame {
  Image<std::uint8_t> gray, moving;
  Image<float> depth;
  SE3<double> T_w_c;
};

const std::vector<Frame>& frames() {
  static const std::vector<Frame> all = [] {
    std::vector<Frame> out;
    test::SceneRenderer renderer(bench::camera<double>(), 640, 480);
    for (int k = 0; k < kFrames; ++k) {
      test::MovingScene scene;
      scene.board.x() = -0.5 + 0.03 * k;
      Eigen::Matrix<double, 6, 1> xi;
      xi << 0.006 * k, 0.002 * k, 0.001 * k, 0, 0.002 * k, 0;
      const SE3<double> T_w_c = SE3<double>::exp(xi);
      renderer.render(scene, T_w_c);
      out.push_back({renderer.gray, renderer.moving, renderer.depth, T_w_c});
    }
    return out;
  }();
  return all;
}

template <class S>
void weights(benchmark::State& state) {
  const auto camera = bench::camera<S>();
  const Frame &reference = frames().front(), &present = frames().back();
  const SE3<S> T = (present.T_w_c.inverse() * reference.T_w_c).template cast<S>();
  bench::Random random(4);
  std::vector<KeypointMatch<S>> matches;
  while (matches.size() < kMatches) {
    const Eigen::Matrix<S, 2, 1> x(S(random.uniform(30, 600)), S(random.uniform(30, 440)));
    const float z = reference.depth(static_cast<int>(x.x() + S(0.5)), static_cast<int>(x.y() + S(0.5)));
    const auto match = keypoint_match(camera, x, S(z), x);
    const auto there = match ? camera.project(T * match->p_ref) : std::nullopt;
    if (!there) continue;
    matches.push_back(*match);
    matches.back().x_m =
        *there + Eigen::Matrix<S, 2, 1>(S(random.uniform(-0.5, 0.5)), S(random.uniform(-0.5, 0.5)));
    if (random.uniform(0, 1) < 0.2) matches.back().x_m += Eigen::Matrix<S, 2, 1>(S(15), S(-9));
  }
  StaticWeightsWorkspace<S> workspace;
  const StaticWeightsOptions<S> options;
  const auto run = [&]() -> const StaticWeightsResult<S>& {
    return static_weights(camera, std::span<const KeypointMatch<S>>(matches), reference.gray, present.gray,
                          present.depth, T, options, workspace);
  };
  const auto& first = run();
  const int moved = first.dynamic_matches + first.mismatches;
  if (!first.ok() || moved < kMatches / 6 || moved > kMatches / 2) {
    state.SkipWithError("one match in five was moved, and the board");
    return;
  }
  state.counters["moved"] = moved;
  for (auto _ : state) benchmark::DoNotOptimize(run().weight.data());
  state.SetItemsProcessed(state.iterations() * kMatches);
}
BENCHMARK(weights<float>)->Name("dynamics/static_weights_1000/float/dynslam")->Unit(benchmark::kMicrosecond);
BENCHMARK(weights<double>)
    ->Name("dynamics/static_weights_1000/double/dynslam")
    ->Unit(benchmark::kMicrosecond);

template <class S>
void segmenter(benchmark::State& state) {
  const auto camera = bench::camera<S>();
  double found = 0, moving = 0, wrong = 0;
  for (auto _ : state) {
    MotionSegmenter<S, Pinhole<S>> motion(camera);
    found = moving = wrong = 0;
    for (const Frame& frame : frames()) {
      const SE3<S> T = frame.T_w_c.cast<S>().inverse();
      const auto& result = motion.segment(frame.gray, frame.depth, T);
      motion.remember(T, result.mask);
      for (int i = 0; i < 640 * 480; ++i) {
        const bool on = result.mask.data()[i] != 0, truth = frame.moving.data()[i] != 0;
        moving += truth ? 1 : 0;
        found += truth && on ? 1 : 0;
        wrong += on && !truth ? 1 : 0;
      }
    }
  }
  // The first frames have no past to be compared with.
  if (!(found > 0.3 * moving)) state.SkipWithError("the board was not found");
  state.counters["recall"] = found / moving;
  state.counters["time_per_frame"] = benchmark::Counter(
      kFrames, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}
BENCHMARK(segmenter<float>)
    ->Name("dynamics/motion_segmenter_20_frames/float/dynslam")
    ->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
