// SPDX-License-Identifier: BSD-3-Clause
// F, H and, of a known camera, E by the sampling loop, beside OpenCV's RANSAC and USAC with the same
// threshold, confidence and bound of iterations. The counters say how many of the right matches each calls
// inliers
// (`right`, of 1), how many of its inliers are wrong matches (`wrong`), and how far the right matches without
// noise are off the model: the RMS of a scene, Sampson's distance of F and E and the transfer error of H,
// median and 95 % of the scenes (`error_px`, `error_px_95`). One iteration is all scenes.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "dynslam/geometry/epipolar.hpp"
#include "dynslam/geometry/essential.hpp"
#include "dynslam/geometry/homography.hpp"
#include "support/two_view_scenes.hpp"

#ifdef DYNSLAM_BENCH_OPENCV
#include "baselines/two_view_opencv.hpp"
#endif

namespace {

using namespace dynslam;

constexpr double kThreshold = 1.5;  // px
constexpr int kIterations = 1000;
enum class Model { fundamental, homography, essential };

/// Of a homography the scenes that have one.
template <class S>
std::vector<bench::TwoViewScene<S>> make_scenes(Model model, int count) {
  std::vector<bench::TwoViewScene<S>> scenes;
  for (int i = 0; static_cast<int>(scenes.size()) < count; ++i) {
    const auto kind = static_cast<bench::SceneKind>(i % 4);
    if (model == Model::homography && kind != bench::SceneKind::plane &&
        kind != bench::SceneKind::plane_and_few)
      continue;
    scenes.push_back(bench::two_view_scene<S>(i));
  }
  return scenes;
}

/// Times find(scene index, flags), which gives F or H, over all scenes, after counting what it finds.
template <class S, class Find>
void find_all(benchmark::State& state, Model model, const std::vector<bench::TwoViewScene<S>>& scenes,
              double least_right, const Find& find) {
  std::vector<double> errors;
  std::vector<std::uint8_t> inlier;
  double right = 0, found = 0, wrong = 0;
  for (std::size_t k = 0; k < scenes.size(); ++k) {
    const auto [sum, n] =
        bench::squared_error(scenes[k], Eigen::Matrix3d(find(k, inlier)), model == Model::homography);
    errors.push_back(std::isfinite(sum) ? std::sqrt(sum / n) : 1e3);
    for (std::size_t i = 0; i < inlier.size(); ++i) {
      right += scenes[k].right[i];
      found += scenes[k].right[i] != 0 && inlier[i] != 0 ? 1 : 0;
      wrong += scenes[k].right[i] == 0 && inlier[i] != 0 ? 1 : 0;
    }
  }
  if (!(found >= least_right * right)) {
    state.SkipWithError("the model misses the matches that are right");
    return;
  }
  for (auto _ : state) {
    for (std::size_t k = 0; k < scenes.size(); ++k) {
      benchmark::DoNotOptimize(find(k, inlier));
      benchmark::DoNotOptimize(inlier.data());
      benchmark::ClobberMemory();
    }
  }
  std::sort(errors.begin(), errors.end());
  state.counters["error_px"] = errors[errors.size() / 2];
  state.counters["error_px_95"] = errors[errors.size() * 95 / 100];
  state.counters["right"] = found / right;
  state.counters["wrong"] = wrong / (found + wrong);
  state.counters["time_per_scene"] =
      benchmark::Counter(static_cast<double>(scenes.size()),
                         benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

double least_right(Model model) {
  return model == Model::homography ? 0.5 : 0.7;
}

template <class S>
void ours(benchmark::State& state, Model model, int count) {
  const auto scenes = make_scenes<S>(model, count);
  RansacOptions<S> options;
  options.threshold_px = S(kThreshold);
  options.max_iterations = kIterations;
  RansacWorkspace workspace;
  EssentialWorkspace rays;
  const auto camera = bench::camera<S>();
  const Eigen::Matrix3d K_inverse = bench::camera<double>().K().inverse();
  using Points = std::span<const Eigen::Matrix<S, 2, 1>>;
  find_all(state, model, scenes, least_right(model),
           [&](std::size_t k, std::vector<std::uint8_t>& inlier) -> Eigen::Matrix3d {
             const Points x(scenes[k].x), x_m(scenes[k].x_m);
             if (model == Model::fundamental) {
               auto found = fundamental_ransac<S>(x, x_m, options, workspace);
               inlier.swap(found.inlier);
               return found.F.template cast<double>();
             }
             if (model == Model::essential) {
               auto found = essential_ransac(camera, x, x_m, options, rays);
               inlier.swap(found.inlier);
               return K_inverse.transpose() * found.E.template cast<double>() * K_inverse;
             }
             auto found = homography_ransac<S>(x, x_m, options, workspace);
             inlier.swap(found.inlier);
             return found.model ? Eigen::Matrix3d(found.model->template cast<double>())
                                : Eigen::Matrix3d::Zero();
           });
}

#ifdef DYNSLAM_BENCH_OPENCV
void opencv(benchmark::State& state, Model model, int count, int method) {
  cv::setNumThreads(1);
  const auto scenes = make_scenes<double>(model, count);
  std::vector<bench::OpenCvMatches> matches(scenes.begin(), scenes.end());
  const auto solve = model == Model::fundamental ? bench::opencv_fundamental
                     : model == Model::essential ? bench::opencv_essential
                                                 : bench::opencv_homography;
  find_all(state, model, scenes, 0, [&](std::size_t k, std::vector<std::uint8_t>& inlier) {
    return solve(matches[k], method, kThreshold, kIterations, inlier);
  });
}
#endif

// Of 40 scenes for a brief run, and of 1000.
void add(const char* what, Model model, int count) {
  const std::string name = std::string("two_view/") + what + "/";
  const auto unit = benchmark::kMillisecond;
  benchmark::RegisterBenchmark((name + "float/dynslam").c_str(), ours<float>, model, count)->Unit(unit);
  benchmark::RegisterBenchmark((name + "double/dynslam").c_str(), ours<double>, model, count)->Unit(unit);
#ifdef DYNSLAM_BENCH_OPENCV
  benchmark::RegisterBenchmark((name + "double/opencv_ransac").c_str(), opencv, model, count, cv::RANSAC)
      ->Unit(unit);
  for (const auto& [method, who] : {std::pair{cv::USAC_DEFAULT, "opencv_usac"},
                                    {cv::USAC_FAST, "opencv_usac_fast"},
                                    {cv::USAC_ACCURATE, "opencv_usac_accurate"},
                                    {cv::USAC_MAGSAC, "opencv_usac_magsac"}})
    benchmark::RegisterBenchmark((name + "double/" + who).c_str(), opencv, model, count, method)->Unit(unit);
#endif
}

}  // namespace

int main(int argc, char** argv) {
  add("fundamental_40_scenes", Model::fundamental, 40);
  add("homography_40_scenes", Model::homography, 40);
  add("essential_40_scenes", Model::essential, 40);
  add("fundamental_1000_scenes", Model::fundamental, 1000);
  add("homography_1000_scenes", Model::homography, 1000);
  add("essential_1000_scenes", Model::essential, 1000);
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
