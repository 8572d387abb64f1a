// SPDX-License-Identifier: BSD-3-Clause
// Finding 8 x 8 templates from 0.9 px away, one after another.
#include "dynslam/optim/patch_alignment.hpp"

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include <benchmark/benchmark.h>

#include "dynslam/image/image.hpp"

#ifdef DYNSLAM_BENCH_OPENCV
#include <opencv2/core.hpp>
#include <opencv2/video/tracking.hpp>
#endif

namespace {

constexpr int kPoints = 400, kWidth = 640, kHeight = 480;
const Eigen::Vector2f kOff(0.7F, -0.6F);  // of the start [px]

dynslam::Image<std::uint8_t> texture() {
  dynslam::Image<std::uint8_t> image(kWidth, kHeight);
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      image(u, v) = static_cast<std::uint8_t>(120 + 40 * std::sin(0.55 * u + 0.2 * v) +
                                              35 * std::cos(0.48 * v - 0.15 * u) +
                                              15 * std::sin(0.9 * u) * std::cos(0.7 * v));
    }
  }
  return image;
}

Eigen::Vector2i place(int k) {
  return {20 + (k * 37) % (kWidth - 40), 20 + (k * 53) % (kHeight - 40)};
}

void set_and_align(benchmark::State& state) {
  const auto image = texture();
  std::vector<std::array<float, 100>> bordered(kPoints);
  for (int k = 0; k < kPoints; ++k) {
    const Eigen::Vector2i c = place(k);
    for (int y = 0; y < 10; ++y) {
      for (int x = 0; x < 10; ++x)
        bordered[static_cast<std::size_t>(k)][static_cast<std::size_t>(y * 10 + x)] =
            static_cast<float>(image(c.x() + x - 5, c.y() + y - 5));
    }
  }
  const auto find = [&](int k) {
    dynslam::AlignmentPatch<float> patch;
    const bool textured = patch.set(bordered[static_cast<std::size_t>(k)], 8.0F);
    auto found = patch.align(image.view(), Eigen::Vector2f(place(k).cast<float>() + kOff));
    if (!textured) found.status = dynslam::PatchAlignmentStatus::unlike;
    return found;
  };
  for (int k = 0; k < kPoints; ++k) {
    const auto found = find(k);
    if (!found.ok() || (found.x - place(k).cast<float>()).norm() > 0.05F) {
      state.SkipWithError("a template was not found");
      return;
    }
  }
  for (auto _ : state) {
    for (int k = 0; k < kPoints; ++k) {
      auto found = find(k);
      benchmark::DoNotOptimize(found);
    }
  }
  state.SetItemsProcessed(state.iterations() * kPoints);
}
BENCHMARK(set_and_align)->Name("patch_alignment/400_patches/float/dynslam")->Unit(benchmark::kMicrosecond);

#ifdef DYNSLAM_BENCH_OPENCV
// Rival: one level of OpenCV's Lucas-Kanade with the nearest window, and as many iterations.
void opencv_lucas_kanade(benchmark::State& state) {
  cv::setNumThreads(1);
  auto image = texture();
  const cv::Mat gray(kHeight, kWidth, CV_8UC1, image.data());
  std::vector<cv::Mat> pyramid;
  cv::buildOpticalFlowPyramid(gray, pyramid, {9, 9}, 0);
  std::vector<cv::Point2f> from, start;
  for (int k = 0; k < kPoints; ++k) {
    from.emplace_back(static_cast<float>(place(k).x()), static_cast<float>(place(k).y()));
    start.emplace_back(from.back().x + kOff.x(), from.back().y + kOff.y());
  }
  std::vector<cv::Point2f> to;
  std::vector<std::uint8_t> found;
  const cv::TermCriteria stop(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 10, 0.02);
  for (auto _ : state) {
    to = start;
    cv::calcOpticalFlowPyrLK(pyramid, pyramid, from, to, found, cv::noArray(), {9, 9}, 0, stop,
                             cv::OPTFLOW_USE_INITIAL_FLOW);
    benchmark::DoNotOptimize(to.data());
  }
  state.SetItemsProcessed(state.iterations() * kPoints);
}
BENCHMARK(opencv_lucas_kanade)
    ->Name("patch_alignment/400_patches/float/opencv")
    ->Unit(benchmark::kMicrosecond);
#endif

}  // namespace

BENCHMARK_MAIN();
