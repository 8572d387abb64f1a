// SPDX-License-Identifier: BSD-3-Clause
// Operations on masks of 640 x 480 pixels, beside OpenCV's: of noise, the worst case, and of a few blobs,
// what a mask of movers is.
#include <benchmark/benchmark.h>

#include <cstdint>
#include <vector>

#include "dynslam/segment/mask.hpp"

#ifdef DYNSLAM_BENCH_OPENCV
#include <opencv2/imgproc.hpp>
#endif

namespace {

using namespace dynslam;

constexpr int kWidth = 640, kHeight = 480, kRadius = 5, kMaxHole = 100;

Image<std::uint8_t> speckles() {
  Image<std::uint8_t> mask(kWidth, kHeight);
  std::uint32_t state = 1;
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      state = state * 1664525U + 1013904223U;
      mask(u, v) = state >> 24 < 140 ? 255 : 0;
    }
  }
  return mask;
}
/// Six discs with small holes.
Image<std::uint8_t> blobs() {
  Image<std::uint8_t> mask(kWidth, kHeight);
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      const int x = u % 213 - 106, y = v % 240 - 120;
      mask(u, v) = x * x + y * y < 8100 && (u % 37 > 4 || v % 41 > 5) ? 255 : 0;
    }
  }
  return mask;
}

template <bool noise, bool grow>
void morphology(benchmark::State& state) {
  const auto in = noise ? speckles() : blobs();
  Image<std::uint8_t> out(kWidth, kHeight);
  MaskWorkspace workspace;
  const auto run = [&] {
    if (grow) {
      dilate(in.view(), out.view(), kRadius, workspace);
    } else {
      erode(in.view(), out.view(), kRadius, workspace);
    }
  };
  run();
#ifdef DYNSLAM_BENCH_OPENCV
  const cv::Mat from(kHeight, kWidth, CV_8U, const_cast<std::uint8_t*>(in.data()));
  cv::Mat expected;
  const cv::Mat square = cv::getStructuringElement(cv::MORPH_RECT, {2 * kRadius + 1, 2 * kRadius + 1});
  (grow ? cv::dilate : cv::erode)(from, expected, square, {-1, -1}, 1, cv::BORDER_CONSTANT,
                                  cv::morphologyDefaultBorderValue());
  if (cv::countNonZero(cv::Mat(kHeight, kWidth, CV_8U, out.data()) != expected) != 0) {
    state.SkipWithError("another mask than OpenCV's");
    return;
  }
#endif
  for (auto _ : state) {
    run();
    benchmark::DoNotOptimize(out.data());
    benchmark::ClobberMemory();
  }
}

template <bool noise>
void components(benchmark::State& state) {
  const auto in = noise ? speckles() : blobs();
  MaskWorkspace workspace;
  Image<int> labels;
  std::vector<int> counts;
  int n = connected_components(in, labels, counts, workspace);
#ifdef DYNSLAM_BENCH_OPENCV
  cv::Mat expected;
  const cv::Mat from(kHeight, kWidth, CV_8U, const_cast<std::uint8_t*>(in.data()));
  if (cv::connectedComponents(from, expected, 8) != n + 1) {
    state.SkipWithError("another number of components than OpenCV's");
    return;
  }
#endif
  for (auto _ : state) {
    n = connected_components(in, labels, counts, workspace);
    benchmark::DoNotOptimize(n);
    benchmark::DoNotOptimize(labels.data());
    benchmark::ClobberMemory();
  }
}

template <bool noise>
void component_areas(benchmark::State& state) {
  const auto in = noise ? speckles() : blobs();
  ComponentsWorkspace workspace;
  std::vector<int> counts;
  for (auto _ : state) {
    benchmark::DoNotOptimize(component_runs(in, Connectivity::eight, counts, workspace));
    benchmark::DoNotOptimize(counts.data());
    benchmark::ClobberMemory();
  }
}

template <bool noise>
void holes(benchmark::State& state) {
  const auto in = noise ? speckles() : blobs();
  MaskWorkspace workspace;
  Image<std::uint8_t> mask = in;
  for (auto _ : state) {
    mask = in;
    fill_holes(mask.view(), kMaxHole, workspace);
    benchmark::DoNotOptimize(mask.data());
    benchmark::ClobberMemory();
  }
  if (mask(0, 37) != 0 || (!noise && mask(111, 123) != 255)) state.SkipWithError("a hole is wrong");
}

#ifdef DYNSLAM_BENCH_OPENCV
template <bool noise, bool grow>
void opencv_morphology(benchmark::State& state) {
  cv::setNumThreads(1);
  auto in = noise ? speckles() : blobs();
  const cv::Mat from(kHeight, kWidth, CV_8U, in.data());
  const cv::Mat square = cv::getStructuringElement(cv::MORPH_RECT, {2 * kRadius + 1, 2 * kRadius + 1});
  cv::Mat out;
  for (auto _ : state) {
    if (grow) {
      cv::dilate(from, out, square);
    } else {
      cv::erode(from, out, square);
    }
    benchmark::DoNotOptimize(out.data);
  }
}
template <bool noise>
void opencv_components(benchmark::State& state) {
  cv::setNumThreads(1);
  auto in = noise ? speckles() : blobs();
  const cv::Mat from(kHeight, kWidth, CV_8U, in.data());
  cv::Mat labels;
  for (auto _ : state) {
    cv::connectedComponents(from, labels, 8, CV_32S);
    benchmark::DoNotOptimize(labels.data);
  }
}
template <bool noise>
void opencv_component_areas(benchmark::State& state) {
  cv::setNumThreads(1);
  auto in = noise ? speckles() : blobs();
  const cv::Mat from(kHeight, kWidth, CV_8U, in.data());
  cv::Mat labels, stats, centroids;
  for (auto _ : state) {
    cv::connectedComponentsWithStats(from, labels, stats, centroids, 8, CV_32S);
    benchmark::DoNotOptimize(stats.data);
  }
}
/// Components of what is not set; the small ones that do not touch the border are set.
template <bool noise>
void opencv_holes(benchmark::State& state) {
  cv::setNumThreads(1);
  auto in = noise ? speckles() : blobs();
  const cv::Mat from(kHeight, kWidth, CV_8U, in.data());
  cv::Mat labels, stats, centroids, mask;
  std::vector<std::uint8_t> fills;
  for (auto _ : state) {
    mask = from.clone();
    const int n = cv::connectedComponentsWithStats(from == 0, labels, stats, centroids, 4, CV_32S);
    fills.assign(static_cast<std::size_t>(n), 0);
    for (int i = 1; i < n; ++i) {
      const int* s = stats.ptr<int>(i);
      const bool touches = s[cv::CC_STAT_LEFT] == 0 || s[cv::CC_STAT_TOP] == 0 ||
                           s[cv::CC_STAT_LEFT] + s[cv::CC_STAT_WIDTH] == kWidth ||
                           s[cv::CC_STAT_TOP] + s[cv::CC_STAT_HEIGHT] == kHeight;
      fills[static_cast<std::size_t>(i)] = !touches && s[cv::CC_STAT_AREA] <= kMaxHole ? 255 : 0;
    }
    for (int v = 0; v < kHeight; ++v) {
      const int* label = labels.ptr<int>(v);
      std::uint8_t* out = mask.ptr(v);
      for (int u = 0; u < kWidth; ++u) out[u] |= fills[static_cast<std::size_t>(label[u])];
    }
    benchmark::DoNotOptimize(mask.data);
  }
}
#define DYNSLAM_MASK(f, rival, name)                                                \
  BENCHMARK(f)->Name("mask/" name "/uint8/dynslam")->Unit(benchmark::kMicrosecond); \
  BENCHMARK(rival)->Name("mask/" name "/uint8/opencv")->Unit(benchmark::kMicrosecond)
#else
#define DYNSLAM_MASK(f, rival, name) \
  BENCHMARK(f)->Name("mask/" name "/uint8/dynslam")->Unit(benchmark::kMicrosecond)
#endif

using benchmark::State;
void dilate_noise(State& s) {
  morphology<true, true>(s);
}
void dilate_blobs(State& s) {
  morphology<false, true>(s);
}
void erode_blobs(State& s) {
  morphology<false, false>(s);
}
#ifdef DYNSLAM_BENCH_OPENCV
void cv_dilate_noise(State& s) {
  opencv_morphology<true, true>(s);
}
void cv_dilate_blobs(State& s) {
  opencv_morphology<false, true>(s);
}
void cv_erode_blobs(State& s) {
  opencv_morphology<false, false>(s);
}
#endif
DYNSLAM_MASK(dilate_noise, cv_dilate_noise, "dilate_noise");
DYNSLAM_MASK(dilate_blobs, cv_dilate_blobs, "dilate_blobs");
DYNSLAM_MASK(erode_blobs, cv_erode_blobs, "erode_blobs");
DYNSLAM_MASK(components<true>, opencv_components<true>, "components_noise");
DYNSLAM_MASK(components<false>, opencv_components<false>, "components_blobs");
DYNSLAM_MASK(component_areas<true>, opencv_component_areas<true>, "component_areas_noise");
DYNSLAM_MASK(component_areas<false>, opencv_component_areas<false>, "component_areas_blobs");
DYNSLAM_MASK(holes<true>, opencv_holes<true>, "holes_noise");
DYNSLAM_MASK(holes<false>, opencv_holes<false>, "holes_blobs");

}  // namespace

BENCHMARK_MAIN();
