// SPDX-License-Identifier: BSD-3-Clause
// A frame's work: static_weights of its matches, and MotionSegmenter as a whole, over 20 rendered frames of
// 640 x 480 with a board that is carried through a room. Nothing else computes the same; the times are for
// comparing versions. The weights are compared with a plain version's, the mismatches with the true epipolar
// lines.
#include <benchmark/benchmark.h>

#include <cmath>
#include <type_traits>
#include <vector>

#include "baselines/static_weights_scalar.hpp"
#include "dynslam/dynamics/motion_segmenter.hpp"
#include "dynslam/dynamics/static_weights.hpp"
#include "dynslam/geometry/epipolar.hpp"
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

/// What is wrong with weights and flags, or null.
template <class S>
const char* wrong_weights(const StaticWeightsResult<S>& result, const std::vector<KeypointMatch<S>>& matches,
                          const SE3<double>& T) {
  if (!result.ok() || result.epipolar != EpipolarVerdict::applied) return "no weights, or no epipolar check";
  const Pinhole<double> pinhole = bench::camera<double>();
  const Eigen::Matrix3d F = fundamental_from_pose(pinhole, pinhole, T);
  const bench::PlainCamera camera{pinhole.fx(), pinhole.fy(), pinhole.cx(), pinhole.cy()};
  std::vector<bench::PlainMatch> plain;
  int far = 0, far_flagged = 0, near = 0, near_flagged = 0;
  for (std::size_t k = 0; k < matches.size(); ++k) {
    plain.push_back({matches[k].x.template cast<double>(), matches[k].p_ref.template cast<double>(),
                     matches[k].x_m.template cast<double>()});
    const double distance = line_distance(F, plain[k].x, plain[k].x_m);
    if (distance > 3) ++far, far_flagged += result.mismatch[k];
    if (distance < 0.75) ++near, near_flagged += result.mismatch[k];
  }
  if (far < kMatches / 10 || 20 * far_flagged < 19 * far || 20 * near_flagged > near)
    return "mismatches that are not those of the true epipolar lines";
  const auto weight = bench::plain_static_weights(camera, plain, frames().front().gray, frames().back().gray,
                                                  frames().back().depth, T.rotation_matrix(), T.translation(),
                                                  result.mismatch, {6, 0.7, 2});
  const double tolerance = std::is_same_v<S, float> ? 2e-3 : 1e-9;
  int wrong = 0;
  for (std::size_t k = 0; k < matches.size(); ++k) {
    wrong += std::abs(weight[k] - double(result.weight[k])) <= tolerance ? 0 : 1;
    const bool dynamic = result.mismatch[k] == 0 && result.weight[k] < S(0.25);
    if (dynamic != (result.dynamic[k] != 0)) return "a flag does not follow from its weight";
  }
  return wrong > 2 ? "another weight than the plain version's"
                   : nullptr;  // rounding decides at a pixel's border
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
  if (const char* wrong = wrong_weights(run(), matches, T.template cast<double>())) {
    state.SkipWithError(wrong);
    return;
  }
  state.counters["moved"] = run().dynamic_matches + run().mismatches;
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
    double t = 0;
    for (const Frame& frame : frames()) {
      const SE3<S> T = frame.T_w_c.cast<S>().inverse();
      const auto& result = motion.segment(frame.gray, frame.depth, t, T);
      t += 1 / 30.0;
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
