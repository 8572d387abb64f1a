// SPDX-License-Identifier: BSD-3-Clause
// F and H by the sampling loop, beside OpenCV's RANSAC and USAC with the same threshold, confidence and bound
// of iterations. The counters say how many of the right matches each calls inliers (`right`, of 1) and how
// many of its inliers are wrong matches (`wrong`). One iteration is all scenes.
#include <benchmark/benchmark.h>

#include <span>
#include <string>
#include <utility>
#include <vector>

#include "dynslam/geometry/epipolar.hpp"
#include "dynslam/geometry/homography.hpp"
#include "support/two_view_scenes.hpp"

#ifdef DYNSLAM_BENCH_OPENCV
#include "baselines/two_view_opencv.hpp"
#endif

namespace {

using namespace dynslam;

constexpr double kThreshold = 1.5;  // px
constexpr int kIterations = 1000;
enum class Model { fundamental, homography };

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

/// Times find(scene index, flags) over all scenes, after counting what it finds.
template <class S, class Find>
void find_all(benchmark::State& state, const std::vector<bench::TwoViewScene<S>>& scenes, double least_right,
              const Find& find) {
  std::vector<std::uint8_t> inlier;
  double right = 0, found = 0, wrong = 0;
  for (std::size_t k = 0; k < scenes.size(); ++k) {
    find(k, inlier);
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
      find(k, inlier);
      benchmark::DoNotOptimize(inlier.data());
      benchmark::ClobberMemory();
    }
  }
  state.counters["right"] = found / right;
  state.counters["wrong"] = wrong / (found + wrong);
  state.counters["time_per_scene"] =
      benchmark::Counter(static_cast<double>(scenes.size()),
                         benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

double least_right(Model model) {
  return model == Model::fundamental ? 0.7 : 0.5;
}

template <class S>
void ours(benchmark::State& state, Model model, int count) {
  const auto scenes = make_scenes<S>(model, count);
  RansacOptions<S> options;
  options.threshold_px = S(kThreshold);
  options.max_iterations = kIterations;
  RansacWorkspace workspace;
  using Points = std::span<const Eigen::Matrix<S, 2, 1>>;
  find_all(state, scenes, least_right(model), [&](std::size_t k, std::vector<std::uint8_t>& inlier) {
    const Points x(scenes[k].x), x_m(scenes[k].x_m);
    if (model == Model::fundamental) {
      inlier = fundamental_ransac<S>(x, x_m, options, workspace).inlier;
    } else {
      inlier = homography_ransac<S>(x, x_m, options, workspace).inlier;
    }
  });
}

#ifdef DYNSLAM_BENCH_OPENCV
void opencv(benchmark::State& state, Model model, int count, int method) {
  cv::setNumThreads(1);
  const auto scenes = make_scenes<double>(model, count);
  std::vector<bench::OpenCvMatches> matches(scenes.begin(), scenes.end());
  find_all(state, scenes, 0, [&](std::size_t k, std::vector<std::uint8_t>& inlier) {
    (model == Model::fundamental ? bench::opencv_fundamental : bench::opencv_homography)(
        matches[k], method, kThreshold, kIterations, inlier);
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
                                    {cv::USAC_ACCURATE, "opencv_usac_accurate"}})
    benchmark::RegisterBenchmark((name + "double/" + who).c_str(), opencv, model, count, method)->Unit(unit);
#endif
}

}  // namespace

int main(int argc, char** argv) {
  add("fundamental_40_scenes", Model::fundamental, 40);
  add("homography_40_scenes", Model::homography, 40);
  add("fundamental_1000_scenes", Model::fundamental, 1000);
  add("homography_1000_scenes", Model::homography, 1000);
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
