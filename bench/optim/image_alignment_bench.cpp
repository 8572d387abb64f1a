// SPDX-License-Identifier: BSD-3-Clause
// The motion between two RGB-D images of 640x480 by their grey values, pyramids included: a turn of 2 degrees
// and a step of 2 cm.
#include "dynslam/optim/image_alignment.hpp"

#include <array>
#include <cmath>
#include <cstdint>
#include <span>

#include <benchmark/benchmark.h>

#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/image/image.hpp"
#include "moved_camera.hpp"
#include "moving_scene.hpp"

#ifdef DYNSLAM_BENCH_RGBD
#include <opencv2/core/eigen.hpp>
#include <opencv2/rgbd.hpp>
#endif

namespace {

using namespace dynslam;

constexpr int kWidth = 640, kHeight = 480, kLevels = 5;
constexpr double kFocal = 525, kLargestError = 0.3;  // [px], mean over the view
const Pinhole<double> kCamera(kFocal, kFocal, 319.5, 239.5);

/// A slanted wall with structure of all sizes, seen twice.
struct Views {
  SE3<double> T_w_image = test::moved(0.015, -0.01, 0.01, 0.035);
  std::array<Image<std::uint8_t>, 2> grey;
  std::array<Image<float>, 2> depth;

  Views() {
    for (std::size_t k = 0; k < 2; ++k) {
      grey[k].resize(kWidth, kHeight);
      depth[k].resize(kWidth, kHeight);
      const SE3<double> T_w_c = k == 0 ? SE3<double>() : T_w_image;
      const Eigen::Vector3d o = T_w_c.translation();
      for (int v = 0; v < kHeight; ++v) {
        for (int u = 0; u < kWidth; ++u) {
          const Eigen::Vector3d d =
              T_w_c.rotation_matrix() * Eigen::Vector3d((u - 319.5) / kFocal, (v - 239.5) / kFocal, 1);
          const double t = (3 + 0.3 * o.x() - o.z()) / (d.z() - 0.3 * d.x());  // z = 3 + 0.3 x
          const Eigen::Vector2d p = (o + t * d).head<2>();
          const auto texture = [&](double size, std::uint64_t seed) {
            return test::surface_texture(p.x() / size, p.y() / size, seed);
          };
          grey[k](u, v) = static_cast<std::uint8_t>(
              20 + 210 * 0.25 * (texture(16, 1) + texture(5, 2) + texture(2, 3) + texture(0.7, 4)));
          depth[k](u, v) = static_cast<float>(t);
        }
      }
    }
  }
  /// How far off a motion puts the view's points in the other image, on average [px].
  [[nodiscard]] double error(const SE3<double>& T_image_reference) const {
    double sum = 0;
    int n = 0;
    for (int v = 20; v < kHeight; v += 40) {
      for (int u = 20; u < kWidth; u += 40) {
        const auto p = kCamera.unproject({u, v}, static_cast<double>(depth[0](u, v)));
        const auto x = kCamera.project(T_image_reference * *p),
                   truth = kCamera.project(T_w_image.inverse() * *p);
        if (!x || !truth) continue;
        sum += (*x - *truth).norm();
        ++n;
      }
    }
    return sum / n;
  }
};

const Views& views() {
  static const Views both;
  return both;
}

template <class S>
void direct_alignment(benchmark::State& state) {
  const Pinhole<S> camera{S(kFocal), S(kFocal), S(319.5), S(239.5)};
  const std::array<SE3<S>, 1> starts{};
  HalvingPyramid<std::uint8_t> reference, image;
  ImageAlignmentWorkspace<S> workspace;
  const auto align = [&] {
    reference.build(views().grey[0], kLevels);
    image.build(views().grey[1], kLevels);
    return align_images<S>(reference, views().depth[0], image, camera, std::span<const SE3<S>>(starts), {},
                           workspace);
  };
  const auto found = align();
  const double error = views().error(found.T_image_reference.template cast<double>());
  if (!found.ok() || !(error < kLargestError)) {
    state.SkipWithError("the motion was not found");
    return;
  }
  for (auto _ : state) {
    auto again = align();
    benchmark::DoNotOptimize(again);
  }
  state.counters["error_px"] = error;
}
BENCHMARK(direct_alignment<float>)
    ->Name("image_alignment/640x480/float/dynslam")
    ->Unit(benchmark::kMillisecond);
BENCHMARK(direct_alignment<double>)
    ->Name("image_alignment/640x480/double/dynslam")
    ->Unit(benchmark::kMillisecond);

#ifdef DYNSLAM_BENCH_RGBD
// Rival: OpenCV's RGB-D odometry, pyramids included, with its defaults.
void opencv_rgbd_odometry(benchmark::State& state) {
  cv::setNumThreads(1);
  Views both = views();
  const cv::Mat K = (cv::Mat_<double>(3, 3) << kFocal, 0, 319.5, 0, kFocal, 239.5, 0, 0, 1);
  const auto odometry = cv::rgbd::RgbdOdometry::create(K);
  const std::array<cv::Mat, 2> grey{cv::Mat(kHeight, kWidth, CV_8UC1, both.grey[0].data()),
                                    cv::Mat(kHeight, kWidth, CV_8UC1, both.grey[1].data())};
  const std::array<cv::Mat, 2> depth{cv::Mat(kHeight, kWidth, CV_32FC1, both.depth[0].data()),
                                     cv::Mat(kHeight, kWidth, CV_32FC1, both.depth[1].data())};
  cv::Mat Rt;
  const auto align = [&] {
    return odometry->compute(grey[0], depth[0], cv::Mat(), grey[1], depth[1], cv::Mat(), Rt);
  };
  const bool ok = align();
  Eigen::Matrix4d T = Eigen::Matrix4d::Identity();
  if (ok) cv::cv2eigen(Rt, T);
  const double error = both.error(
      SE3<double>(SO3<double>(Eigen::Matrix3d(T.topLeftCorner<3, 3>())), T.topRightCorner<3, 1>()));
  if (!ok || !(error < 5 * kLargestError)) {
    state.SkipWithError("the motion was not found");
    return;
  }
  for (auto _ : state) {
    bool again = align();
    benchmark::DoNotOptimize(again);
  }
  state.counters["error_px"] = error;
}
BENCHMARK(opencv_rgbd_odometry)->Name("image_alignment/640x480/double/opencv")->Unit(benchmark::kMillisecond);
#endif

}  // namespace

BENCHMARK_MAIN();
