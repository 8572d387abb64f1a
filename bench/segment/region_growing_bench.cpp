// SPDX-License-Identifier: BSD-3-Clause
// Growing on a depth image of 640 x 480: smooth, made up with noise and holes, and recorded (fr1_xyz) where
// DYNSLAM_DATA names the data: regions of several sizes there, with the limits that they have by default.
// Beside OpenCV's floodFill where it knows the rule (a fixed step), and a queue written for the one rule that
// is asked for.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "dynslam/image/image.hpp"
#include "dynslam/segment/region_growing.hpp"
#include "support/named.hpp"
#include "support/recorded_files.hpp"
#include "support/rng.hpp"

#ifdef DYNSLAM_BENCH_OPENCV
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#endif

namespace {

using namespace dynslam;

constexpr int kWidth = 640, kHeight = 480;
enum class Surface { smooth, measured };

/// Where growing begins, and in what.
template <class S>
struct Scene {
  const Image<S>* depth;
  PixelIndex seed;
};

/// A wave of depths before a wall: one region of 60 % of the image, another one around it. Measured: with
/// noise, of which a part is more than a step, and holes.
template <class S>
Scene<S> wave(Surface surface) {
  static const auto make = [](bool measured) {
    bench::Random random(3);
    Image<S> out(kWidth, kHeight, S(4));
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        if (v >= 48 && v < 432 && u >= 80 && u < 560)
          out(u, v) = S(2.0 + 0.1 * std::sin(0.05 * u) * std::cos(0.07 * v));
        if (!measured) continue;
        out(u, v) += S(0.004 * random.normal());
        if (random.uniform(0, 1) < 0.003) out(u, v) += S(0.1);
        if (u % 97 < 7 && v % 61 < 11) out(u, v) = S(0);
      }
    }
    return out;
  };
  static const Image<S> smooth = make(false), measured = make(true);
  return {surface == Surface::smooth ? &smooth : &measured, {320, 240}};
}

/// As one writes it for one rule.
template <class S, class Step>
std::size_t queue_fill(const Scene<S>& scene, const Step& may_step, std::vector<std::uint8_t>& mask,
                       std::vector<int>& queue) {
  mask.assign(kWidth * kHeight, 0);
  queue.assign(1, scene.seed.v * kWidth + scene.seed.u);
  mask[static_cast<std::size_t>(queue[0])] = 255;
  const S* z = scene.depth->data();
  for (std::size_t head = 0; head < queue.size(); ++head) {
    const int i = queue[head], u = i % kWidth, v = i / kWidth;
    const auto visit = [&](int j) {
      if (mask[static_cast<std::size_t>(j)] != 0 || !(z[j] > 0) || !may_step(z[i], z[j])) return;
      mask[static_cast<std::size_t>(j)] = 255;
      queue.push_back(j);
    };
    if (u > 0) visit(i - 1);
    if (u + 1 < kWidth) visit(i + 1);
    if (v > 0) visit(i - kWidth);
    if (v + 1 < kHeight) visit(i + kWidth);
  }
  return queue.size();
}
template <class S>
constexpr auto kRelative = [](S a, S b) {
  const S nearer = std::min(a, b);
  return std::abs(a - b) < S(0.02) + S(0.005) * nearer * nearer;
};
template <class S>
constexpr auto kFixed = [](S a, S b) { return std::abs(a - b) < S(0.03); };

template <class S, class Step>
void plain_queue(benchmark::State& state, const Scene<S>& scene, const Step& step) {
  std::vector<std::uint8_t> mask;
  std::vector<int> queue;
  for (auto _ : state) {
    benchmark::DoNotOptimize(queue_fill(scene, step, mask, queue));
    benchmark::ClobberMemory();
  }
}

/// @param plain  the same rule, for the queue that tells the right answer
/// @param limit  share of the image beyond which a region is dropped; below 1 what is valid is counted as
///               far as that asks for
template <class S, class Criterion, class Step>
void grow(benchmark::State& state, const Scene<S>& scene, const Criterion& criterion, const Step& plain,
          double limit = 1) {
  Image<std::uint8_t> mask(kWidth, kHeight);
  RegionGrowingWorkspace workspace;
  RegionGrowingOptions options;
  options.max_region_fraction = options.max_total_fraction = limit;
  const auto run = [&] {
    return grow_regions(*scene.depth, std::span<const PixelIndex>(&scene.seed, 1), criterion, options, mask,
                        workspace);
  };
  std::vector<std::uint8_t> expected;
  std::vector<int> queue;
  if (run().pixels != queue_fill(scene, plain, expected, queue) ||
      !std::equal(expected.begin(), expected.end(), mask.data())) {
    state.SkipWithError("another region than the queue's");
    return;
  }
  for (auto _ : state) {
    benchmark::DoNotOptimize(run().pixels);
    benchmark::ClobberMemory();
  }
  state.counters["pixels"] = static_cast<double>(queue.size());
}

#ifdef DYNSLAM_BENCH_OPENCV
void opencv_flood_fill(benchmark::State& state, const Scene<float>& scene) {
  cv::setNumThreads(1);
  cv::Mat image(kHeight, kWidth, CV_32FC1, const_cast<float*>(scene.depth->data()));
  cv::Mat mask(kHeight + 2, kWidth + 2, CV_8UC1);
  const auto run = [&] {
    mask.setTo(0);
    return cv::floodFill(image, mask, {scene.seed.u, scene.seed.v}, {}, nullptr, 0.03, 0.03,
                         4 | cv::FLOODFILL_MASK_ONLY | 255 << 8);
  };
  run();
  std::vector<std::uint8_t> expected;
  std::vector<int> queue;
  queue_fill(scene, kFixed<float>, expected, queue);
  const cv::Mat truth(kHeight, kWidth, CV_8UC1, expected.data());
  if (cv::countNonZero(mask({1, 1, kWidth, kHeight}) != truth) != 0) {
    state.SkipWithError("another region than the queue's");
    return;
  }
  for (auto _ : state) {
    benchmark::DoNotOptimize(run());
    benchmark::ClobberMemory();
  }
}

/// The middle depth image of fr1_xyz [m]; empty where the data are absent.
const Image<float>& recorded_depth() {
  static const auto depth = [] {
    const auto files = bench::recorded_files("depth");
    Image<float> out;
    if (files.empty()) return out;
    cv::Mat z = cv::imread(files[files.size() / 2].string(), cv::IMREAD_UNCHANGED);
    z.convertTo(z, CV_32F, 1.0 / 5000);
    out = Image<float>(kWidth, kHeight);
    std::copy_n(z.ptr<float>(), kWidth * kHeight, out.data());
    return out;
  }();
  return depth;
}

/// Of seeds all over the recorded image that whose region is nearest to a size.
Scene<float> recorded(std::size_t pixels) {
  const Image<float>& depth = recorded_depth();
  std::vector<std::uint8_t> mask;
  std::vector<int> queue;
  Scene<float> best{&depth, {0, 0}};
  double least = 1e9;
  for (int v = 10; v < kHeight; v += 20) {
    for (int u = 10; u < kWidth; u += 20) {
      if (!(depth(u, v) > 0)) continue;
      const auto size =
          static_cast<double>(queue_fill(Scene<float>{&depth, {u, v}}, kFixed<float>, mask, queue));
      const double off = std::abs(std::log(size / static_cast<double>(pixels)));
      if (off < least) best.seed = {u, v};
      least = std::min(least, off);
    }
  }
  return best;
}
#endif

template <class S>
void add_all() {
  using benchmark::State;
  const char* scalar = bench::kScalarName<S>;
  const RelativeStep<S> relative{S(0.02), S(0.005)};
  const FixedStep<S> fixed{S(0.03)};
  static const Image<std::uint8_t> labels(kWidth, kHeight, 1);
  for (const Surface surface : {Surface::smooth, Surface::measured}) {
    const std::string name = surface == Surface::smooth ? "" : "_measured";
    const Scene<S> scene = wave<S>(surface);
    const auto add = [&](const char* what, const char* who, auto f) {
      bench::add("region_growing/" + (what + name), scalar, who, f);
    };
    add("relative_step", "dynslam", [=](State& s) { grow<S>(s, scene, relative, kRelative<S>); });
    add("relative_step", "queue", [=](State& s) { plain_queue<S>(s, scene, kRelative<S>); });
    add("fixed_step", "dynslam", [=](State& s) { grow<S>(s, scene, fixed, kFixed<S>); });
    add("fixed_step", "queue", [=](State& s) { plain_queue<S>(s, scene, kFixed<S>); });
    add("fixed_step_with_limit", "dynslam", [=](State& s) { grow<S>(s, scene, fixed, kFixed<S>, 0.9); });
    add("same_label", "dynslam",
        [=](State& s) { grow<S>(s, scene, SameLabelStep(labels, relative), kRelative<S>); });
#ifdef DYNSLAM_BENCH_OPENCV
    if constexpr (std::is_same_v<S, float>) {
      add("fixed_step", "opencv", [=](State& s) { opencv_flood_fill(s, scene); });
      add("fixed_step_with_limit", "opencv", [=](State& s) { opencv_flood_fill(s, scene); });
    }
#endif
  }
}

#ifdef DYNSLAM_BENCH_OPENCV
void add_recorded() {
  using benchmark::State;
  if (recorded_depth().width() == 0) return;
  const RegionGrowingOptions options;
  for (const std::size_t pixels : {500, 3000, 10000, 30000}) {
    const std::string name = "region_growing/recorded_" + std::to_string(pixels);
    const auto scene = recorded(pixels);
    bench::add(name, "float", "dynslam", [=](State& s) {
      grow<float>(s, scene, FixedStep<float>{0.03F}, kFixed<float>, options.max_region_fraction);
    });
    bench::add(name, "float", "opencv", [=](State& s) { opencv_flood_fill(s, scene); });
  }
}
#endif

const bool registered = [] {
  add_all<float>();
  add_all<double>();
#ifdef DYNSLAM_BENCH_OPENCV
  add_recorded();
#endif
  return true;
}();

}  // namespace

BENCHMARK_MAIN();
