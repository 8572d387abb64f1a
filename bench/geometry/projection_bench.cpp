// SPDX-License-Identifier: BSD-3-Clause
// Projection and unprojection of 1000 points, with and without lens and derivative, beside OpenCV (which
// gives the derivatives by ten and more parameters when asked for any) and a plain loop with Eigen.
#include <benchmark/benchmark.h>

#include <cmath>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "dynslam/geometry/brown_conrady.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "support/rng.hpp"

#ifdef DYNSLAM_BENCH_OPENCV
#include <opencv2/calib3d.hpp>
#endif

namespace {

using namespace dynslam;

constexpr int kPoints = 1000;
constexpr double kFx = 517.3, kFy = 516.5, kCx = 318.6, kCy = 255.3;
constexpr double kLens[5] = {0.2624, -0.9531, -0.0054, 0.0026, 1.1633};  // k1 k2 p1 p2 k3 of freiburg1

std::vector<Eigen::Vector3d> points() {
  bench::Random random(3);
  std::vector<Eigen::Vector3d> out;
  for (int i = 0; i < kPoints; ++i) {
    const double z = random.uniform(0.8, 5);
    out.emplace_back((random.uniform(40, 600) - kCx) / kFx * z, (random.uniform(40, 440) - kCy) / kFy * z, z);
  }
  return out;
}
template <class S>
std::vector<Eigen::Matrix<S, 3, 1>> points_of() {
  std::vector<Eigen::Matrix<S, 3, 1>> out;
  for (const auto& p : points()) out.push_back(p.cast<S>());
  return out;
}

template <class S, bool lens>
auto make_camera() {
  const Pinhole<S> pinhole{S(kFx), S(kFy), S(kCx), S(kCy)};
  if constexpr (lens) {
    return PinholeBrownConrady<S>(
        pinhole, BrownConrady<S>(S(kLens[0]), S(kLens[1]), S(kLens[2]), S(kLens[3]), S(kLens[4])));
  } else {
    return pinhole;
  }
}

template <class S, bool lens, bool jacobian>
void project(benchmark::State& state) {
  const auto camera = make_camera<S, lens>();
  const auto p = points_of<S>();
  std::vector<Eigen::Matrix<S, 2, 1>> x(kPoints);
  std::vector<Eigen::Matrix<S, 2, 3>> J(kPoints);
  int seen = 0;
  const auto run = [&] {
    seen = 0;
    for (std::size_t i = 0; i < kPoints; ++i) {
      const auto pixel = jacobian ? camera.project(p[i], &J[i]) : camera.project(p[i]);
      if (!pixel) continue;
      x[i] = *pixel;
      ++seen;
    }
  };
  run();
  for (std::size_t i = 0; i < kPoints; i += 50) {
    const auto back = camera.unproject(x[i], p[i].z());
    if (seen != kPoints || !back || (*back - p[i]).norm() > S(1e-3)) {
      state.SkipWithError("the pixel is not the point's");
      return;
    }
  }
  for (auto _ : state) {
    run();
    benchmark::DoNotOptimize(x.data());
    benchmark::DoNotOptimize(J.data());
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * kPoints);
}

template <class S, bool lens>
void unproject(benchmark::State& state) {
  const auto camera = make_camera<S, lens>();
  const auto p = points_of<S>();
  std::vector<Eigen::Matrix<S, 2, 1>> x;
  for (const auto& q : p) x.push_back(*camera.project(q));
  std::vector<Eigen::Matrix<S, 3, 1>> out(kPoints, Eigen::Matrix<S, 3, 1>::Zero());
  const auto run = [&] {
    for (std::size_t i = 0; i < kPoints; ++i) {
      if (const auto q = camera.unproject(x[i], p[i].z())) out[i] = *q;
    }
  };
  run();
  for (std::size_t i = 0; i < kPoints; ++i) {
    if ((out[i] - p[i]).norm() > S(2e-3)) {
      state.SkipWithError("the point is not the pixel's");
      return;
    }
  }
  for (auto _ : state) {
    run();
    benchmark::DoNotOptimize(out.data());
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * kPoints);
}

/// As one writes it with Eigen, without a lens and without asking whether the point is in front.
template <class S>
void plain_eigen(benchmark::State& state) {
  Eigen::Matrix<S, 3, 3> K;
  K << S(kFx), S(0), S(kCx), S(0), S(kFy), S(kCy), S(0), S(0), S(1);
  const auto p = points_of<S>();
  std::vector<Eigen::Matrix<S, 2, 1>> x(kPoints);
  for (auto _ : state) {
    for (std::size_t i = 0; i < kPoints; ++i) x[i] = (K * p[i]).hnormalized();
    benchmark::DoNotOptimize(x.data());
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * kPoints);
}

#ifdef DYNSLAM_BENCH_OPENCV
const cv::Matx33d kK(kFx, 0, kCx, 0, kFy, kCy, 0, 0, 1);

template <bool lens, bool jacobian>
void opencv_project(benchmark::State& state) {
  cv::setNumThreads(1);
  std::vector<cv::Point3d> p;
  for (const auto& q : points()) p.emplace_back(q.x(), q.y(), q.z());
  const cv::Mat distortion = lens ? cv::Mat(1, 5, CV_64F, const_cast<double*>(kLens)).clone() : cv::Mat();
  const cv::Vec3d zero(0, 0, 0);
  std::vector<cv::Point2d> x;
  cv::Mat J;
  for (auto _ : state) {
    if (jacobian) {
      cv::projectPoints(p, zero, zero, kK, distortion, x, J);
    } else {
      cv::projectPoints(p, zero, zero, kK, distortion, x);
    }
    benchmark::DoNotOptimize(x.data());
    benchmark::DoNotOptimize(J.data);
  }
  state.SetItemsProcessed(state.iterations() * kPoints);
}

template <bool lens>
void opencv_unproject(benchmark::State& state) {
  cv::setNumThreads(1);
  const auto camera = make_camera<double, lens>();
  std::vector<cv::Point2d> x, n;
  for (const auto& q : points()) {
    const auto pixel = *camera.project(q);
    x.emplace_back(pixel.x(), pixel.y());
  }
  const cv::Mat distortion = lens ? cv::Mat(1, 5, CV_64F, const_cast<double*>(kLens)).clone() : cv::Mat();
  for (auto _ : state) {
    cv::undistortPoints(x, n, kK, distortion);
    benchmark::DoNotOptimize(n.data());
  }
  state.SetItemsProcessed(state.iterations() * kPoints);
}
BENCHMARK(opencv_project<false, false>)->Name("projection/pinhole/double/opencv");
BENCHMARK(opencv_project<false, true>)->Name("projection/pinhole_jacobian/double/opencv");
BENCHMARK(opencv_project<true, false>)->Name("projection/lens/double/opencv");
BENCHMARK(opencv_project<true, true>)->Name("projection/lens_jacobian/double/opencv");
BENCHMARK(opencv_unproject<false>)->Name("projection/unproject_pinhole/double/opencv");
BENCHMARK(opencv_unproject<true>)->Name("projection/unproject_lens/double/opencv");
#endif

#define DYNSLAM_PROJECTION(S, scalar)                                                         \
  BENCHMARK(project<S, false, false>)->Name("projection/pinhole/" scalar "/dynslam");         \
  BENCHMARK(plain_eigen<S>)->Name("projection/pinhole/" scalar "/eigen");                     \
  BENCHMARK(project<S, false, true>)->Name("projection/pinhole_jacobian/" scalar "/dynslam"); \
  BENCHMARK(project<S, true, false>)->Name("projection/lens/" scalar "/dynslam");             \
  BENCHMARK(project<S, true, true>)->Name("projection/lens_jacobian/" scalar "/dynslam");     \
  BENCHMARK(unproject<S, false>)->Name("projection/unproject_pinhole/" scalar "/dynslam");    \
  BENCHMARK(unproject<S, true>)->Name("projection/unproject_lens/" scalar "/dynslam")
DYNSLAM_PROJECTION(float, "float");
DYNSLAM_PROJECTION(double, "double");

}  // namespace

BENCHMARK_MAIN();
