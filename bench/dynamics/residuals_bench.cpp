// SPDX-License-Identifier: BSD-3-Clause
// The errors of 1000 keypoints and their joint weight (Eqs 3, 5, 6 and 7), beside a plain loop in double,
// Ceres' automatic differentiation of the same by the pose, and the part of it that OpenCV has: projection,
// remap of the grey image and the difference.
#include <benchmark/benchmark.h>

#include <cmath>
#include <string>
#include <vector>

#include "baselines/residuals_scalar.hpp"
#include "dynslam/dynamics/residual_batch.hpp"
#include "dynslam/dynamics/residuals.hpp"
#include "dynslam/dynamics/static_weight.hpp"
#include "support/rng.hpp"
#include "support/scene.hpp"

#ifdef DYNSLAM_BENCH_CERES
#include <ceres/jet.h>
#include <ceres/rotation.h>
#endif
#ifdef DYNSLAM_BENCH_OPENCV
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#endif

namespace {

using namespace dynslam;

constexpr int kMatches = 1000, kWidth = 640, kHeight = 480;
constexpr double kNu = 5;
const Eigen::Vector3d kSigma(8, 1, 2);  // grey values, pixels, standard deviations of the depth

struct Problem {
  Image<std::uint8_t> reference{kWidth, kHeight}, gray{kWidth, kHeight};
  Image<float> depth{kWidth, kHeight};
  SE3<double> T;
  std::vector<bench::PlainMatch> matches;
  bench::PlainCamera camera{535.4, 539.2, 320.1, 247.6};
  std::vector<bench::PlainResidual<double>> truth;

  Problem() {
    bench::Random random(11);
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        reference(u, v) = static_cast<std::uint8_t>(120 + 60 * std::sin(0.1 * u) * std::cos(0.13 * v));
        gray(u, v) = static_cast<std::uint8_t>(120 + 60 * std::sin(0.1 * u + 0.4) * std::cos(0.13 * v));
        depth(u, v) = random.uniform(0, 1) < 0.05 ? 0.0F : static_cast<float>(random.uniform(1, 5));
      }
    }
    Eigen::Matrix<double, 6, 1> xi;
    xi << 0.03, -0.02, 0.01, 0.01, -0.02, 0.015;
    T = SE3<double>::exp(xi);
    const Pinhole<double> pinhole = bench::camera<double>();
    while (matches.size() < kMatches) {
      const Eigen::Vector2d x(random.uniform(1, kWidth - 2), random.uniform(1, kHeight - 2));
      const Eigen::Vector3d p = pinhole.ray(x) * random.uniform(1, 5);
      const Eigen::Vector2d noise(random.uniform(-2, 2), random.uniform(-2, 2));
      const Eigen::Vector2d x_m = *pinhole.project(T * p) + noise;
      matches.push_back({x, p, x_m});
      truth.push_back(bench::plain_residual<double>(camera, matches.back(), reference, gray, depth,
                                                    T.rotation_matrix(), T.translation(), kSigma, kNu,
                                                    below));
    }
  }
  static int below(double x) { return static_cast<int>(std::floor(x)); }
};
const Problem& problem() {
  static const Problem made;
  return made;
}

/// Share of matches whose weight is not the plain loop's: at the border of a pixel or of the image rounding
/// decides.
template <class Weight>
bool answers(benchmark::State& state, double tolerance, const Weight& weight) {
  int wrong = 0;
  for (std::size_t k = 0; k < kMatches; ++k)
    wrong += std::abs(weight(k) - problem().truth[k].weight) <= tolerance ? 0 : 1;
  if (wrong > 2) state.SkipWithError("the weights are wrong");
  return wrong <= 2;
}

template <class S>
void batch(benchmark::State& state) {
  const Problem& p = problem();
  MatchRows<S> rows;
  for (const auto& m : p.matches) rows.push_back(m.x.cast<S>(), m.p.cast<S>(), m.x_m.cast<S>());
  const auto camera = bench::camera<S>();
  const SE3<S> T = p.T.cast<S>();
  const StaticWeightScales<S> scales{S(kSigma[0]), S(kSigma[1]), S(kSigma[2])};
  const auto reference = p.reference.view(), gray = p.gray.view();
  const auto depth = p.depth.view();
  ResidualRows<S> out;
  const auto run = [&] {
    residual_batch<S>(camera, rows, reference, gray, depth, T, scales, DepthNoise<S>{}, S(kNu), out);
  };
  run();
  if (!answers(state, std::is_same_v<S, float> ? 2e-3 : 1e-9,
               [&](std::size_t k) { return double(out.weight[k]); }))
    return;
  for (auto _ : state) {
    run();
    benchmark::DoNotOptimize(out.weight.data());
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * kMatches);
}

/// One by one by the functions that take any camera.
template <class S>
void one_by_one(benchmark::State& state) {
  const Problem& p = problem();
  const auto camera = bench::camera<S>();
  const SE3<S> pose = p.T.cast<S>();
  std::vector<S> weight(kMatches);
  const auto run = [&] {
    const auto T = pose.isometry();
    for (std::size_t k = 0; k < kMatches; ++k) {
      const Eigen::Matrix<S, 3, 1> p_c = T * p.matches[k].p.cast<S>();
      const Eigen::Matrix<S, 2, 1> x_m = p.matches[k].x_m.cast<S>();
      const auto x = camera.project(p_c);
      if (!x) continue;
      const KeypointResiduals<S> r{
          photometric_residual(p.reference, p.matches[k].x.cast<S>().eval(), p.gray, *x),
          reprojection_residual(*x, x_m), depth_residual(p_c, p.depth, x_m)};
      const S sigma = S(kSigma[2]) * DepthNoise<S>{}.sigma(p_c.z());
      weight[k] = static_weight(r, StaticWeightScales<S>{S(kSigma[0]), S(kSigma[1]), sigma}, S(kNu));
    }
  };
  run();
  if (!answers(state, std::is_same_v<S, float> ? 2e-3 : 1e-9,
               [&](std::size_t k) { return double(weight[k]); }))
    return;
  for (auto _ : state) {
    run();
    benchmark::DoNotOptimize(weight.data());
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * kMatches);
}

void plain(benchmark::State& state) {
  const Problem& p = problem();
  std::vector<bench::PlainResidual<double>> out(kMatches);
  const Eigen::Matrix3d R = p.T.rotation_matrix();
  const Eigen::Vector3d t = p.T.translation();
  for (auto _ : state) {
    for (std::size_t k = 0; k < kMatches; ++k)
      out[k] = bench::plain_residual<double>(p.camera, p.matches[k], p.reference, p.gray, p.depth, R, t,
                                             kSigma, kNu, Problem::below);
    benchmark::DoNotOptimize(out.data());
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * kMatches);
}

#ifdef DYNSLAM_BENCH_CERES
/// What a cost function of Ceres does for these errors: dual numbers over the six parameters of the pose.
void ceres_autodiff(benchmark::State& state) {
  using Jet = ceres::Jet<double, 6>;
  const Problem& p = problem();
  std::vector<bench::PlainResidual<Jet>> out(kMatches);
  const Eigen::Matrix<double, 6, 1> xi = p.T.log();
  const Eigen::Vector3d w = xi.tail<3>(), t0 = p.T.translation();
  const auto below = [](const Jet& x) { return static_cast<int>(std::floor(x.a)); };
  const auto run = [&] {
    for (std::size_t k = 0; k < kMatches; ++k) {
      Eigen::Matrix<Jet, 3, 1> angle, t;
      for (int i = 0; i < 3; ++i) {
        t[i] = Jet(t0[i], i);
        angle[i] = Jet(w[i], 3 + i);
      }
      Eigen::Matrix<Jet, 3, 3> R;
      ceres::AngleAxisToRotationMatrix(angle.data(), R.data());
      out[k] = bench::plain_residual<Jet>(p.camera, p.matches[k], p.reference, p.gray, p.depth, R, t, kSigma,
                                          kNu, below);
    }
  };
  run();
  if (!answers(state, 1e-9, [&](std::size_t k) { return out[k].weight.a; })) return;
  for (auto _ : state) {
    run();
    benchmark::DoNotOptimize(out.data());
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * kMatches);
}
BENCHMARK(ceres_autodiff)
    ->Name("residuals/triple_and_weight_1000/double/ceres")
    ->Unit(benchmark::kMicrosecond);
#endif

#ifdef DYNSLAM_BENCH_OPENCV
/// Eqs 3 and 5 alone.
void opencv(benchmark::State& state) {
  cv::setNumThreads(1);
  const Problem& p = problem();
  std::vector<cv::Point3f> points;
  std::vector<cv::Point2f> x, x_m, projected;
  for (const auto& m : p.matches) {
    points.emplace_back(float(m.p.x()), float(m.p.y()), float(m.p.z()));
    x.emplace_back(float(m.x.x()), float(m.x.y()));
    x_m.emplace_back(float(m.x_m.x()), float(m.x_m.y()));
  }
  const Eigen::Vector3d w = p.T.so3().log(), t = p.T.translation();
  const cv::Vec3d rvec(w.x(), w.y(), w.z()), tvec(t.x(), t.y(), t.z());
  const cv::Matx33d K(p.camera.fx, 0, p.camera.cx, 0, p.camera.fy, p.camera.cy, 0, 0, 1);
  const cv::Mat reference(kHeight, kWidth, CV_8U, const_cast<std::uint8_t*>(p.reference.data()));
  const cv::Mat gray(kHeight, kWidth, CV_8U, const_cast<std::uint8_t*>(p.gray.data()));
  cv::Mat before, now, e_i, offset, e_c;
  for (auto _ : state) {
    cv::projectPoints(points, rvec, tvec, K, cv::noArray(), projected);
    cv::remap(reference, before, cv::Mat(x), cv::noArray(), cv::INTER_LINEAR);
    cv::remap(gray, now, cv::Mat(projected), cv::noArray(), cv::INTER_LINEAR);
    cv::subtract(before, now, e_i, cv::noArray(), CV_32F);
    cv::subtract(cv::Mat(projected), cv::Mat(x_m), offset);
    std::vector<cv::Mat> parts;
    cv::split(offset, parts);
    cv::magnitude(parts[0], parts[1], e_c);
    benchmark::DoNotOptimize(e_i.data);
    benchmark::DoNotOptimize(e_c.data);
  }
  state.SetItemsProcessed(state.iterations() * kMatches);
}
BENCHMARK(opencv)
    ->Name("residuals/triple_and_weight_1000/float/opencv_without_depth")
    ->Unit(benchmark::kMicrosecond);
#endif

#define DYNSLAM_RESIDUALS(f, scalar, who) \
  BENCHMARK(f)->Name("residuals/triple_and_weight_1000/" scalar "/" who)->Unit(benchmark::kMicrosecond)
DYNSLAM_RESIDUALS(batch<float>, "float", "dynslam");
DYNSLAM_RESIDUALS(batch<double>, "double", "dynslam");
DYNSLAM_RESIDUALS(one_by_one<float>, "float", "dynslam_one_by_one");
DYNSLAM_RESIDUALS(one_by_one<double>, "double", "dynslam_one_by_one");
DYNSLAM_RESIDUALS(plain, "double", "scalar");

}  // namespace

BENCHMARK_MAIN();
