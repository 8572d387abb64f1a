// SPDX-License-Identifier: BSD-3-Clause
// Growing on a depth image of 640 x 480, beside a queue written for this one criterion and OpenCV's floodFill
// with a fixed step (it knows no other): what the criterion as a parameter costs.
#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "dynslam/segment/region_growing.hpp"

#ifdef DYNSLAM_BENCH_OPENCV
#include <opencv2/imgproc.hpp>
#endif

namespace {

using namespace dynslam;

constexpr int kWidth = 640, kHeight = 480;
constexpr float kStep = 0.03F;

/// A wave of depths before a wall: one region of 60 % of the image, another one around it.
const Image<float>& depth() {
  static const Image<float> image = [] {
    Image<float> out(kWidth, kHeight, 4.0F);
    for (int v = 48; v < 432; ++v) {
      for (int u = 80; u < 560; ++u)
        out(u, v) =
            2.0F + 0.1F * std::sin(0.05F * static_cast<float>(u)) * std::cos(0.07F * static_cast<float>(v));
    }
    return out;
  }();
  return image;
}
const std::vector<PixelIndex> kSeeds{{320, 240}};

RegionGrowingOptions all() {
  RegionGrowingOptions options;
  options.max_region_fraction = options.max_total_fraction = 1;
  return options;
}
constexpr std::size_t kPixels = 480 * 384;

template <class Criterion>
void grow(benchmark::State& state, const Criterion& criterion) {
  Image<std::uint8_t> mask(kWidth, kHeight);
  RegionGrowingWorkspace workspace;
  const auto options = all();
  for (auto _ : state) {
    const auto result =
        grow_regions(depth(), std::span<const PixelIndex>(kSeeds), criterion, options, mask, workspace);
    if (result.pixels != kPixels) state.SkipWithError("another region");
    benchmark::DoNotOptimize(mask.data());
  }
}
void relative_step(benchmark::State& state) {
  grow(state, RelativeStep<float>{0.02F, 0.005F});
}
void fixed_step(benchmark::State& state) {
  grow(state, FixedStep<float>{kStep});
}
void same_label(benchmark::State& state) {
  const Image<std::uint8_t> labels(kWidth, kHeight, 1);
  grow(state, SameLabelStep(labels, RelativeStep<float>{0.02F, 0.005F}));
}
BENCHMARK(relative_step)->Name("region_growing/relative_step/float/dynslam")->Unit(benchmark::kMicrosecond);
BENCHMARK(fixed_step)->Name("region_growing/fixed_step/float/dynslam")->Unit(benchmark::kMicrosecond);
BENCHMARK(same_label)->Name("region_growing/same_label/float/dynslam")->Unit(benchmark::kMicrosecond);

void plain_queue(benchmark::State& state) {
  std::vector<std::uint8_t> mask(kWidth * kHeight);
  std::vector<int> queue;
  for (auto _ : state) {
    std::fill(mask.begin(), mask.end(), std::uint8_t{0});
    queue.assign(1, 240 * kWidth + 320);
    mask[240 * kWidth + 320] = 255;
    const float* z = depth().data();
    for (std::size_t head = 0; head < queue.size(); ++head) {
      const int i = queue[head], u = i % kWidth, v = i / kWidth;
      const auto visit = [&](int j) {
        if (mask[static_cast<std::size_t>(j)] != 0 || !(z[j] > 0)) return;
        const float nearer = std::min(z[i], z[j]);
        if (!(std::abs(z[i] - z[j]) < 0.02F + 0.005F * nearer * nearer)) return;
        mask[static_cast<std::size_t>(j)] = 255;
        queue.push_back(j);
      };
      if (u > 0) visit(i - 1);
      if (u + 1 < kWidth) visit(i + 1);
      if (v > 0) visit(i - kWidth);
      if (v + 1 < kHeight) visit(i + kWidth);
    }
    if (queue.size() != kPixels) state.SkipWithError("another region");
    benchmark::DoNotOptimize(mask.data());
  }
}
BENCHMARK(plain_queue)->Name("region_growing/relative_step/float/queue")->Unit(benchmark::kMicrosecond);

#ifdef DYNSLAM_BENCH_OPENCV
void opencv_flood_fill(benchmark::State& state) {
  cv::setNumThreads(1);
  const cv::Mat image(kHeight, kWidth, CV_32FC1, const_cast<float*>(depth().data()));
  cv::Mat mask;
  for (auto _ : state) {
    mask = cv::Mat::zeros(kHeight + 2, kWidth + 2, CV_8UC1);
    cv::Mat unchanged = image;
    const int pixels = cv::floodFill(unchanged, mask, {320, 240}, {}, nullptr, static_cast<double>(kStep),
                                     static_cast<double>(kStep), 4 | cv::FLOODFILL_MASK_ONLY | 255 << 8);
    if (static_cast<std::size_t>(pixels) != kPixels) state.SkipWithError("another region");
    benchmark::DoNotOptimize(mask.data);
  }
}
BENCHMARK(opencv_flood_fill)->Name("region_growing/fixed_step/float/opencv")->Unit(benchmark::kMicrosecond);
#endif

}  // namespace

BENCHMARK_MAIN();
