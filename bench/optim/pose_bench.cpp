// SPDX-License-Identifier: BSD-3-Clause
// Poses from 300 known points. Least squares from a guess, on pixels alone (all that solvePnPRefineLM takes)
// and with depth; robust with 15 % gross outliers; by consensus with 15 and 40 % of them, with a prediction
// (pose_consensus, until an outlier-free sample was drawn with a probability of 99 %, as OpenCV does it, or
// all 120 samples) and without (absolute_pose, with depth and of pixels alone, which is what OpenCV has).
// Each answer is compared with the truth. The counters say how far the camera's centre is off over 40
// problems of each kind, median and 95 % (`error_mm`, `error_mm_95`), and which share of the right
// observations the poses explain (`right`, of 1).
#include <algorithm>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#ifdef DYNSLAM_BENCH_CERES
#include "baselines/pose_ceres.hpp"
#endif
#ifdef DYNSLAM_BENCH_OPENCV
#include "baselines/pose_opencv.hpp"
#endif
#include "dynslam/optim/absolute_pose.hpp"
#include "dynslam/optim/pose.hpp"
#include "dynslam/optim/pose_consensus.hpp"
#include "dynslam/robust/kernels.hpp"
#include "dynslam/robust/t_distribution.hpp"
#include "support/named.hpp"
#include "support/scene.hpp"

namespace {

using namespace dynslam;
using bench::PoseProblem;

constexpr int kPoints = 300;
constexpr double kBound = 2.4477;  // [px]: chi-square 95 % of two pixels, as kChiSquare95<2>

template <class S>
PoseProblem<S> problem_of(double outliers, bool depth, std::uint64_t seed) {
  auto problem = bench::pose_problem<S>(kPoints, outliers, seed);
  if (depth) return problem;
  for (auto& o : problem.observations) o.inv_sigma_z2 = S(0);
  return problem;
}

template <class S>
double error_of(const PoseProblem<S>& problem, const SE3<S>& T) {
  return static_cast<double>((T * problem.T_c_w.inverse()).log().norm());
}

/// Observations within the bound of the true pose, and those of them that are within it of another pose, too.
template <class S>
std::pair<int, int> explained(const PoseProblem<S>& problem, const SE3<S>& T) {
  const auto camera = bench::camera<S>();
  const S bound = S(kBound * kBound);
  std::pair<int, int> of_found{0, 0};
  for (auto o : problem.observations) {
    o.inv_sigma_z2 = S(0);
    if (!(observation_chi2(camera, problem.T_c_w, o) < bound)) continue;
    ++of_found.first;
    of_found.second += observation_chi2(camera, T, o) < bound ? 1 : 0;
  }
  return of_found;
}

/// Times what `make` makes of a problem, a function that gives the pose, after all its errors were found to
/// be small enough.
template <class S, class Make>
void time_pose(benchmark::State& state, double outliers, bool depth, double largest, const Make& make) {
  constexpr std::uint64_t kProblems = 40;
  std::vector<double> errors;
  double of = 0, found = 0;
  for (std::uint64_t seed = 0; seed < kProblems; ++seed) {
    const auto problem = problem_of<S>(outliers, depth, seed);
    auto solve = make(problem);
    const SE3<S> T(solve());
    if (!(error_of(problem, T) < largest)) {
      state.SkipWithError("the pose is wrong");
      return;
    }
    const Eigen::Matrix<S, 3, 1> off = T.inverse().translation() - problem.T_c_w.inverse().translation();
    errors.push_back(1e3 * static_cast<double>(off.norm()));
    const auto [right, explains] = explained(problem, T);
    of += right;
    found += explains;
  }
  std::sort(errors.begin(), errors.end());
  state.counters["error_mm"] = errors[errors.size() / 2];
  state.counters["error_mm_95"] = errors[errors.size() * 95 / 100];
  state.counters["right"] = found / of;
  const auto problem = problem_of<S>(outliers, depth, 7);
  auto solve = make(problem);
  for (auto _ : state) {
    auto pose = solve();
    benchmark::DoNotOptimize(pose);
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * kPoints);
}

template <class S, class Kernel>
void ours(benchmark::State& state, double outliers, bool depth, int rounds, const Kernel& kernel) {
  const auto camera = bench::camera<S>();
  PoseOptions<S> options;
  options.rounds = rounds;
  PoseWorkspace<S> workspace;
  time_pose<S>(state, outliers, depth, 0.002, [&](const PoseProblem<S>& problem) {
    return [&] {
      return optimize_pose<S>(camera, problem.observations, problem.initial, options, kernel, workspace)
          .T_c_w;
    };
  });
}

#ifdef DYNSLAM_BENCH_CERES
void ceres_solver(benchmark::State& state, double outliers, bool depth, bool robust) {
  time_pose<double>(state, outliers, depth, 0.01, [&](const PoseProblem<double>& problem) {
    return [&] {
      return baselines::ceres_pose(bench::camera<double>(), problem.observations, problem.initial, robust);
    };
  });
}
void ceres_tiny(benchmark::State& state, bool depth) {
  ceres::TinySolver<baselines::TinyPose> solver;
  time_pose<double>(state, 0, depth, 0.01, [&](const PoseProblem<double>& problem) {
    return [&] {
      return baselines::tiny_pose(solver, bench::camera<double>(), problem.observations, problem.initial);
    };
  });
}
#endif

#ifdef DYNSLAM_BENCH_OPENCV
void refine_lm(benchmark::State& state) {
  time_pose<double>(state, 0, false, 0.01, [](const PoseProblem<double>& problem) {
    return [&, rival = baselines::OpenCvPose(bench::camera<double>(), problem.observations)]() mutable {
      return rival.refine(problem.initial);
    };
  });
}
#endif

template <class S>
void ours_consensus(benchmark::State& state, double outliers, double confidence) {
  const auto camera = bench::camera<S>();
  PoseConsensusOptions<S> options;
  options.confidence = S(confidence);
  PoseConsensusWorkspace workspace;
  time_pose<S>(state, outliers, true, 0.05, [&](const PoseProblem<S>& problem) {
    return [&] {
      return pose_consensus<S>(camera, problem.observations, {}, problem.initial, {}, options, workspace)
          .T_c_w;
    };
  });
}
template <class S>
void ours_absolute(benchmark::State& state, double outliers, bool depth) {
  const auto camera = bench::camera<S>();
  AbsolutePoseWorkspace workspace;
  PoseWorkspace<S> refinement;
  PoseOptions<S> options;
  options.rounds = 1;
  time_pose<S>(state, outliers, depth, 0.05, [&](const PoseProblem<S>& problem) {
    return [&] {
      const auto found = absolute_pose<S>(camera, problem.observations, {}, workspace);
      return optimize_pose<S>(camera, problem.observations, found.T_c_w, options,
                              TDistribution<S>::with_dimension(S(5), 1), refinement)
          .T_c_w;
    };
  });
}

#ifdef DYNSLAM_BENCH_OPENCV
void opencv_ransac(benchmark::State& state, double outliers, int method) {
  time_pose<double>(state, outliers, true, 0.05, [=](const PoseProblem<double>& problem) {
    return [=, rival = baselines::OpenCvPose(bench::camera<double>(), problem.observations)]() mutable {
      return rival.ransac(method, kBound);
    };
  });
}
#endif

template <class S>
void register_ours() {
  const char* name = bench::kScalarName<S>;
  const auto least_squares = [=](const char* what, bool depth) {
    bench::add(what, name, "dynslam",
               [=](benchmark::State& s) { ours<S>(s, 0, depth, 1, SquaredLoss<S>()); });
  };
  least_squares("pose_only/300_pixels", false);
  least_squares("pose_only/300_depth", true);
  bench::add("pose_only/300_robust", name, "dynslam", [](benchmark::State& s) {
    ours<S>(s, 0.15, true, 1, TDistribution<S>::with_dimension(S(5), 1));
  });
  bench::add("pose_only/300_robust_2_rounds", name, "dynslam", [](benchmark::State& s) {
    ours<S>(s, 0.15, true, 2, TDistribution<S>::with_dimension(S(5), 1));
  });
  for (const int percent : {15, 40}) {
    const std::string size = "/300_" + std::to_string(percent) + "_percent_wrong";
    const double outliers = 0.01 * percent;
    bench::add("pose_consensus" + size, name, "dynslam",
               [=](benchmark::State& s) { ours_consensus<S>(s, outliers, 0.99); });
    bench::add("pose_consensus_120" + size, name, "dynslam",
               [=](benchmark::State& s) { ours_consensus<S>(s, outliers, 0); });
    bench::add("absolute_pose" + size, name, "dynslam",
               [=](benchmark::State& s) { ours_absolute<S>(s, outliers, true); });
    bench::add("absolute_pose_of_pixels" + size, name, "dynslam",
               [=](benchmark::State& s) { ours_absolute<S>(s, outliers, false); });
  }
}

const bool registered = [] {
  register_ours<double>();
  register_ours<float>();
#ifdef DYNSLAM_BENCH_CERES
  bench::add("pose_only/300_pixels", "double", "ceres",
             [](benchmark::State& s) { ceres_solver(s, 0, false, false); });
  bench::add("pose_only/300_depth", "double", "ceres",
             [](benchmark::State& s) { ceres_solver(s, 0, true, false); });
  for (const char* what : {"pose_only/300_robust", "pose_only/300_robust_2_rounds"})
    bench::add(what, "double", "ceres", [](benchmark::State& s) { ceres_solver(s, 0.15, true, true); });
  bench::add("pose_only/300_pixels", "double", "ceres_tiny",
             [](benchmark::State& s) { ceres_tiny(s, false); });
  bench::add("pose_only/300_depth", "double", "ceres_tiny", [](benchmark::State& s) { ceres_tiny(s, true); });
#endif
#ifdef DYNSLAM_BENCH_OPENCV
  bench::add("pose_only/300_pixels", "double", "opencv", [](benchmark::State& s) { refine_lm(s); });
  for (const int percent : {15, 40}) {
    for (const char* family :
         {"pose_consensus", "pose_consensus_120", "absolute_pose", "absolute_pose_of_pixels"}) {
      const std::string what = std::string(family) + "/300_" + std::to_string(percent) + "_percent_wrong";
      const double outliers = 0.01 * percent;
      bench::add(what, "double", "opencv_p3p",
                 [=](benchmark::State& s) { opencv_ransac(s, outliers, cv::SOLVEPNP_AP3P); });
      bench::add(what, "double", "opencv_epnp",
                 [=](benchmark::State& s) { opencv_ransac(s, outliers, cv::SOLVEPNP_EPNP); });
      bench::add(what, "double", "opencv_usac",
                 [=](benchmark::State& s) { opencv_ransac(s, outliers, cv::USAC_DEFAULT); });
    }
  }
#endif
  return true;
}();

}  // namespace

BENCHMARK_MAIN();
