// SPDX-License-Identifier: BSD-3-Clause
// Robust pose from known points with 15 % gross outliers, by the number of points.
#include "dynslam/optim/pose.hpp"

#include <vector>

#include <benchmark/benchmark.h>

#include "dynslam/robust/t_distribution.hpp"
#include "support/scene.hpp"

#ifdef DYNSLAM_BENCH_OPENCV
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#endif

namespace {

using dynslam::bench::pose_problem;

template <class S>
void optimize(benchmark::State& state) {
  const auto problem = pose_problem<S>(static_cast<int>(state.range(0)), 0.15);
  const auto camera = dynslam::bench::camera<S>();
  const dynslam::PoseOptions<S> options;
  const dynslam::TDistribution<S> kernel;
  dynslam::PoseWorkspace<S> workspace;
  const auto solve = [&] {
    return dynslam::optimize_pose<S>(camera, problem.observations, problem.initial, options, kernel,
                                     workspace);
  };

  const auto check = solve();
  const S error = (check.T_c_w * problem.T_c_w.inverse()).log().norm();
  if (!(error < S(0.005))) {
    state.SkipWithError("the pose is wrong");
    return;
  }
  state.counters["translation_error"] =
      static_cast<double>((check.T_c_w.translation() - problem.T_c_w.translation()).norm());
  for (auto _ : state) {
    auto result = solve();
    benchmark::DoNotOptimize(result);
    benchmark::DoNotOptimize(workspace.inlier.data());
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * state.range(0));
}
BENCHMARK_TEMPLATE(optimize, double)->Arg(100)->Arg(500)->Arg(2000)->Unit(benchmark::kMicrosecond);

#ifdef DYNSLAM_BENCH_OPENCV
// Rival: RANSAC and refinement of OpenCV, which uses the pixels alone.
void opencv_pnp_ransac(benchmark::State& state) {
  const auto problem = pose_problem<double>(static_cast<int>(state.range(0)), 0.15);
  const auto camera = dynslam::bench::camera<double>();
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> pixels;
  for (const auto& o : problem.observations) {
    points.emplace_back(o.p_w.x(), o.p_w.y(), o.p_w.z());
    pixels.emplace_back(o.x.x(), o.x.y());
  }
  const cv::Matx33d K(camera.fx(), 0, camera.cx(), 0, camera.fy(), camera.cy(), 0, 0, 1);
  cv::Vec3d rotation;
  cv::Vec3d translation;
  const auto solve = [&] {
    // RANSAC with the minimal solver, then refinement over its inliers.
    std::vector<int> inliers;
    if (!cv::solvePnPRansac(points, pixels, K, cv::noArray(), rotation, translation, false, 100, 2.45F, 0.99,
                            inliers, cv::SOLVEPNP_AP3P)) {
      return false;
    }
    std::vector<cv::Point3d> inlier_points;
    std::vector<cv::Point2d> inlier_pixels;
    for (const int i : inliers) {
      inlier_points.push_back(points[static_cast<std::size_t>(i)]);
      inlier_pixels.push_back(pixels[static_cast<std::size_t>(i)]);
    }
    cv::solvePnPRefineLM(inlier_points, inlier_pixels, K, cv::noArray(), rotation, translation);
    return true;
  };
  const bool solved = solve();
  const Eigen::Vector3d t(translation[0], translation[1], translation[2]);
  const double error = (t - problem.T_c_w.translation()).norm();
  if (!solved || !(error < 0.02)) {
    state.SkipWithError("the pose is wrong");
    return;
  }
  state.counters["translation_error"] = error;
  for (auto _ : state) {
    const bool again = solve();
    benchmark::DoNotOptimize(again);
    benchmark::DoNotOptimize(rotation);
    benchmark::DoNotOptimize(translation);
  }
  state.SetItemsProcessed(state.iterations() * state.range(0));
}
BENCHMARK(opencv_pnp_ransac)->Arg(100)->Arg(500)->Arg(2000)->Unit(benchmark::kMicrosecond);
#endif

}  // namespace

BENCHMARK_MAIN();
