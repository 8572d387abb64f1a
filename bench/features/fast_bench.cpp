// SPDX-License-Identifier: BSD-3-Clause
// FAST corners of a 640 x 480 image with their scores, the largest of their neighbours alone, beside
// OpenCV's; both give the same corners. The image is a recorded one where DYNSLAM_DATA names the data.
#include <benchmark/benchmark.h>

#ifdef DYNSLAM_BENCH_OPENCV
#include <algorithm>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "dynslam/runtime/slam/fast_corners.hpp"
#include "support/named.hpp"
#include "support/recorded_files.hpp"

namespace {

using namespace dynslam;
using runtime::FastCorner, runtime::FastCorners;

cv::Mat grey_image() {
  if (const auto files = bench::recorded_files("rgb"); !files.empty())
    return cv::imread(files.front().string(), cv::IMREAD_GRAYSCALE);
  cv::Mat image(480, 640, CV_8UC1);
  cv::RNG random(7);
  random.fill(image, cv::RNG::UNIFORM, 0, 256);
  cv::GaussianBlur(image, image, {9, 9}, 2.5);
  cv::normalize(image, image, 0, 255, cv::NORM_MINMAX);
  return image;
}

void by_opencv(const cv::Mat& image, int threshold, std::vector<cv::KeyPoint>& out) {
  cv::FAST(image, out, threshold, true);
}
/// @param corners  without a rim of the ring, as OpenCV's
void by_dynslam(FastCorners& fast, const cv::Mat& image, int threshold, std::vector<FastCorner>& corners) {
  constexpr int kRing = FastCorners::kRing;
  fast.find(image, {kRing, kRing, image.cols - 2 * kRing, image.rows - 2 * kRing}, threshold, corners);
}

/// @param once  once(image)
template <class Once>
void time_corners(benchmark::State& state, int threshold, const Once& once) {
  cv::setNumThreads(1);
  const cv::Mat image = grey_image();
  FastCorners fast;
  std::vector<FastCorner> corners;
  std::vector<cv::KeyPoint> others;
  by_dynslam(fast, image, threshold, corners);
  by_opencv(image, threshold, others);
  const auto same = [](const FastCorner& a, const cv::KeyPoint& b) {
    return cv::Point2f(cv::Point(a.u, a.v)) == b.pt && static_cast<float>(a.score) == b.response;
  };
  if (corners.empty() || !std::ranges::equal(corners, others, same)) {
    state.SkipWithError("other corners");
    return;
  }
  for (auto _ : state) once(image);
  state.counters["corners"] = static_cast<double>(corners.size());
}

const bool registered = [] {
  for (const int threshold : {20, 7}) {  // TrackerOptions::features: at first, and where too few are found
    const std::string what = "fast/threshold_" + std::to_string(threshold) + "_640x480";
    bench::add(what, "uint8", "dynslam", [=](benchmark::State& s) {
      FastCorners fast;
      std::vector<FastCorner> corners;
      time_corners(s, threshold, [&](const cv::Mat& image) {
        by_dynslam(fast, image, threshold, corners);
        benchmark::DoNotOptimize(corners.data());
      });
    });
    bench::add(what, "uint8", "opencv", [=](benchmark::State& s) {
      std::vector<cv::KeyPoint> corners;
      time_corners(s, threshold, [&](const cv::Mat& image) {
        by_opencv(image, threshold, corners);
        benchmark::DoNotOptimize(corners.data());
      });
    });
  }
  return true;
}();

}  // namespace
#endif

BENCHMARK_MAIN();
