// SPDX-License-Identifier: BSD-3-Clause
// Images of 640 x 480: values between pixels, with gradient, of a whole warped image, and pyramids, beside
// OpenCV.
#include <benchmark/benchmark.h>

#include <cmath>
#include <vector>

#include "dynslam/image/image.hpp"
#include "dynslam/image/pyramid.hpp"
#include "dynslam/image/sample.hpp"
#include "support/rng.hpp"

#ifdef DYNSLAM_BENCH_OPENCV
#include <opencv2/imgproc.hpp>
#endif

namespace {

using namespace dynslam;

constexpr int kWidth = 640, kHeight = 480, kLevels = 4;

const Image<std::uint8_t>& gray() {
  static const Image<std::uint8_t> image = [] {
    Image<std::uint8_t> out(kWidth, kHeight);
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u)
        out(u, v) = static_cast<std::uint8_t>(120 + 60 * std::sin(0.1 * u) * std::cos(0.13 * v));
    }
    return out;
  }();
  return image;
}
/// Where the warped image takes each pixel from: a turn and a shift, inside the image.
const std::vector<Eigen::Vector2f>& places() {
  static const std::vector<Eigen::Vector2f> all = [] {
    std::vector<Eigen::Vector2f> out;
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u)
        out.emplace_back(
            std::min(638.0F, std::max(0.0F, 0.98F * static_cast<float>(u) + 0.02F * static_cast<float>(v))),
            std::min(478.0F, std::max(0.0F, 0.97F * static_cast<float>(v) + 5.3F)));
    }
    return out;
  }();
  return all;
}

template <class S, bool gradient>
void warp(benchmark::State& state) {
  std::vector<S> value(places().size());
  std::vector<Eigen::Matrix<S, 2, 1>> slope(places().size());
  const Image<std::uint8_t>& image = gray();
  const std::vector<Eigen::Vector2f>& from = places();
  const auto run = [&] {
    for (std::size_t i = 0; i < value.size(); ++i) {
      const S u = S(from[i].x()), v = S(from[i].y());
      if constexpr (gradient) {
        const auto s = bilinear_with_gradient<S>(image, u, v);
        value[i] = s ? s->value : S(0);
        if (s) slope[i] = s->gradient;
      } else {
        value[i] = bilinear<S>(image, u, v).value_or(S(0));
      }
    }
  };
  run();
  const double there =
      120 + 60 * std::sin(0.1 * double(places()[100000].x())) * std::cos(0.13 * double(places()[100000].y()));
  if (std::abs(double(value[100000]) - there) > 2) {
    state.SkipWithError("a value is wrong");
    return;
  }
  for (auto _ : state) {
    run();
    benchmark::DoNotOptimize(value.data());
    benchmark::DoNotOptimize(slope.data());
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * kWidth * kHeight);
}

template <class T>
void pyramid(benchmark::State& state) {
  Image<T> base(kWidth, kHeight);
  for (int i = 0; i < kWidth * kHeight; ++i) base.data()[i] = static_cast<T>(gray().data()[i]);
  HalvingPyramid<T> levels;
  for (auto _ : state) {
    levels.build(base, kLevels);
    benchmark::DoNotOptimize(levels.image(kLevels - 1).data());
    benchmark::ClobberMemory();
  }
  const double mean = double(base(320, 240) + base(321, 240) + base(320, 241) + base(321, 241)) / 4.0;
  if (std::abs(double(levels.image(1)(160, 120)) - mean) > 0.6) state.SkipWithError("a pixel is wrong");
}

#ifdef DYNSLAM_BENCH_OPENCV
template <bool gradient>
void opencv_warp(benchmark::State& state) {
  cv::setNumThreads(1);
  const cv::Mat from(kHeight, kWidth, CV_8U, const_cast<std::uint8_t*>(gray().data()));
  const cv::Mat map(kHeight, kWidth, CV_32FC2, const_cast<Eigen::Vector2f*>(places().data()));
  cv::Mat floats, dx, dy, value, along_u, along_v;
  for (auto _ : state) {
    from.convertTo(floats, CV_32F);
    cv::remap(floats, value, map, cv::noArray(), cv::INTER_LINEAR);
    if constexpr (gradient) {  // central differences of the image, interpolated
      cv::Sobel(floats, dx, CV_32F, 1, 0, 1, 0.5);
      cv::Sobel(floats, dy, CV_32F, 0, 1, 1, 0.5);
      cv::remap(dx, along_u, map, cv::noArray(), cv::INTER_LINEAR);
      cv::remap(dy, along_v, map, cv::noArray(), cv::INTER_LINEAR);
    }
    benchmark::DoNotOptimize(value.data);
    benchmark::DoNotOptimize(along_v.data);
  }
  state.SetItemsProcessed(state.iterations() * kWidth * kHeight);
}
template <int type>
void opencv_pyramid(benchmark::State& state) {
  cv::setNumThreads(1);
  cv::Mat base;
  cv::Mat(kHeight, kWidth, CV_8U, const_cast<std::uint8_t*>(gray().data())).convertTo(base, type);
  std::vector<cv::Mat> levels(kLevels);
  for (auto _ : state) {
    base.copyTo(levels[0]);
    for (std::size_t k = 1; k < kLevels; ++k)
      cv::resize(levels[k - 1], levels[k], {kWidth >> k, kHeight >> k}, 0, 0, cv::INTER_AREA);
    benchmark::DoNotOptimize(levels.back().data);
  }
}
BENCHMARK(opencv_warp<false>)->Name("image/warp/float/opencv")->Unit(benchmark::kMicrosecond);
BENCHMARK(opencv_warp<true>)->Name("image/warp_with_gradient/float/opencv")->Unit(benchmark::kMicrosecond);
BENCHMARK(opencv_pyramid<CV_8U>)->Name("image/pyramid_4/uint8/opencv")->Unit(benchmark::kMicrosecond);
BENCHMARK(opencv_pyramid<CV_32F>)->Name("image/pyramid_4/float/opencv")->Unit(benchmark::kMicrosecond);
#endif

BENCHMARK(warp<float, false>)->Name("image/warp/float/dynslam")->Unit(benchmark::kMicrosecond);
BENCHMARK(warp<double, false>)->Name("image/warp/double/dynslam")->Unit(benchmark::kMicrosecond);
BENCHMARK(warp<float, true>)->Name("image/warp_with_gradient/float/dynslam")->Unit(benchmark::kMicrosecond);
BENCHMARK(warp<double, true>)->Name("image/warp_with_gradient/double/dynslam")->Unit(benchmark::kMicrosecond);
BENCHMARK(pyramid<std::uint8_t>)->Name("image/pyramid_4/uint8/dynslam")->Unit(benchmark::kMicrosecond);
BENCHMARK(pyramid<float>)->Name("image/pyramid_4/float/dynslam")->Unit(benchmark::kMicrosecond);

}  // namespace

BENCHMARK_MAIN();
