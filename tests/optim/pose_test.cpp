// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/optim/pose.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include "dynslam/robust/kernels.hpp"
#include "jacobian.hpp"
#include "random.hpp"
#include "tum_cameras.hpp"

using namespace dynslam;

namespace {

SE3d true_pose() {
  Eigen::Matrix<double, 6, 1> xi;
  xi << 0.3, -0.2, 0.1, 0.15, -0.1, 0.2;
  return SE3d::exp(xi);
}

/// Points in front of the true camera; the first `outliers` of them moved after the map was made.
template <class S>
std::vector<PoseObservation<S>> observe(test::Rng& rng, int n, int outliers, double pixel_noise,
                                        double depth_noise) {
  std::vector<PoseObservation<S>> all;
  const SE3d T = true_pose();
  for (int i = 0; i < n; ++i) {
    const Eigen::Vector2d x(rng.uniform(10, 630), rng.uniform(10, 470));
    const double z = rng.uniform(0.8, 4);
    Eigen::Vector3d p_c = test::kFreiburg3.ray(x) * z;
    PoseObservation<S> o;
    o.p_w = (T.inverse() * p_c).cast<S>();
    if (i < outliers)
      p_c += Eigen::Vector3d(rng.uniform(0.2, 0.6), rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2));
    o.x = (*test::kFreiburg3.project(p_c) + pixel_noise * Eigen::Vector2d(rng.normal(), rng.normal()))
              .cast<S>();
    o.depth = static_cast<S>(p_c.z() + depth_noise * rng.normal());
    o.inv_sigma_px2 = static_cast<S>(1 / std::max(1e-4, pixel_noise * pixel_noise));
    o.inv_sigma_z2 = static_cast<S>(1 / std::max(1e-6, depth_noise * depth_noise));
    all.push_back(o);
  }
  return all;
}

template <class S>
double error(const SE3<S>& T) {
  return (T.template cast<double>() * true_pose().inverse()).log().norm();
}

}  // namespace

TEST_CASE("the residual's Jacobian equals central differences on the manifold; a flipped sign is seen") {
  test::Rng rng("pose jacobian");
  for (const auto& o : observe<double>(rng, 100, 50, 1.0, 0.02)) {
    Eigen::Vector3d r;
    Eigen::Matrix<double, 3, 6> J;
    REQUIRE(pose_residual<double>(test::kFreiburg3, true_pose(), o, r, &J));
    const auto f = [&](const Eigen::Matrix<double, 6, 1>& delta) -> Eigen::Vector3d {
      Eigen::Vector3d value;
      REQUIRE(pose_residual<double>(test::kFreiburg3, SE3d::exp(delta) * true_pose(), o, value, nullptr));
      return value;
    };
    const Eigen::Matrix<double, 3, 6> numeric =
        test::central_differences<3, 6>(f, Eigen::Matrix<double, 6, 1>::Zero().eval());
    CHECK(test::relative_error(J, numeric) < 1e-6);
    J(1, 3) = -J(1, 3);
    CHECK(test::relative_error(J, numeric) > 1e-2);
  }
}

TEST_CASE("the normal equations of a pose equal those of its Jacobian's rows") {
  test::Rng rng("pose equations");
  PoseEquations<double> sums;
  NormalEquations<double, 6> rows, blocks;
  for (const auto& o : observe<double>(rng, 50, 20, 1.0, 0.02)) {
    Eigen::Vector3d r;
    Eigen::Matrix<double, 3, 6> J;
    REQUIRE(pose_residual<double>(test::kFreiburg3, true_pose(), o, r, &J));
    const double pixel = rng.uniform(0.1, 2), depth = rng.chance(0.3) ? 0.0 : rng.uniform(10, 1000);
    rows.add_row(J.row(0), r.x(), pixel);
    rows.add_row(J.row(1), r.y(), pixel);
    rows.add_row(J.row(2), r.z(), depth);
    sums.add(PoseTerms<double>(test::kFreiburg3, true_pose() * o.p_w, r, pixel, depth));
  }
  sums.store(blocks);
  CHECK(test::relative_error(blocks.hessian(), rows.hessian()) < 1e-12);
  CHECK(test::relative_error(blocks.gradient(), rows.gradient()) < 1e-12);
}

TEST_CASE_TEMPLATE("the pose is recovered exactly from exact data, far from the start", S, float, double) {
  test::Rng rng("exact pose");
  const auto observations = observe<S>(rng, 200, 0, 0.0, 0.0);
  PoseWorkspace<S> workspace;
  const auto result =
      optimize_pose<S>(test::kFreiburg3.cast<S>(), observations, SE3<S>(), PoseOptions<S>{5, 20},
                       TDistribution<S>::with_dimension(S(5), 1), workspace);
  CHECK(result.ok());
  CHECK(result.inliers == 200);
  CHECK(error(result.T_c_w) < (std::is_same_v<S, float> ? 1e-4 : 1e-8));
}

TEST_CASE("40 % of moved points neither bend the pose nor pass for inliers") {
  test::Rng rng("pose outliers");
  const auto observations = observe<double>(rng, 500, 200, 0.7, 0.01);
  PoseWorkspace<double> workspace;
  const SE3d start =
      SE3d::exp((Eigen::Matrix<double, 6, 1>() << 0.05, 0.02, -0.03, 0.02, 0.01, -0.02).finished()) *
      true_pose();
  const auto result = optimize_pose<double>(test::kFreiburg3, observations, start, {},
                                            TDistribution<double>::with_dimension(5.0, 1), workspace);
  CHECK(result.ok());
  CHECK(error(result.T_c_w) < 2e-3);
  int accepted = 0, rejected = 0;
  for (std::size_t i = 0; i < 500; ++i)
    (i < 200 ? accepted : rejected) += (i < 200) == (workspace.inlier[i] != 0) ? 1 : 0;
  CHECK(accepted == 0);
  CHECK(rejected < 45);  // 5 % by chi-square, and some luck
}

TEST_CASE("the covariance predicts the scatter of the estimates") {
  test::Rng rng("pose covariance");
  Eigen::Matrix<double, 6, 6> scatter = Eigen::Matrix<double, 6, 6>::Zero(), predicted = scatter;
  PoseWorkspace<double> workspace;
  constexpr int kTrials = 300;
  PoseOptions<double> options;
  options.rounds = 1;
  for (int k = 0; k < kTrials; ++k) {
    const auto observations = observe<double>(rng, 120, 0, 1.0, 0.02);
    const auto result = optimize_pose<double>(test::kFreiburg3, observations, true_pose(), options,
                                              SquaredLoss<double>{}, workspace);
    const Eigen::Matrix<double, 6, 1> e = (result.T_c_w * true_pose().inverse()).log();
    scatter += e * e.transpose() / kTrials;
    predicted += result.covariance / kTrials;
  }
  for (int i = 0; i < 6; ++i)
    CHECK(std::sqrt(scatter(i, i)) == doctest::Approx(std::sqrt(predicted(i, i))).epsilon(0.15));
}

TEST_CASE("depth settles what reprojection leaves open") {
  test::Rng rng("depth helps");
  const auto observations = observe<double>(rng, 40, 0, 1.0, 0.002);
  PoseWorkspace<double> workspace;
  PoseOptions<double> without;
  without.use_depth = false;
  const auto a = optimize_pose<double>(test::kFreiburg3, observations, true_pose(), {},
                                       TDistribution<double>::with_dimension(5.0, 1), workspace);
  const auto b = optimize_pose<double>(test::kFreiburg3, observations, true_pose(), without,
                                       TDistribution<double>::with_dimension(5.0, 1), workspace);
  CHECK(a.covariance(2, 2) < 0.25 * b.covariance(2, 2));
}

TEST_CASE("bad input has its own status each") {
  test::Rng rng("bad input");
  PoseWorkspace<double> workspace;
  auto observations = observe<double>(rng, 30, 0, 1.0, 0.02);
  const auto kernel = TDistribution<double>::with_dimension(5.0, 1);
  CHECK(
      optimize_pose<double>(test::kFreiburg3, std::span(observations).first(3), SE3d(), {}, kernel, workspace)
          .status == PoseStatus::too_few_observations);
  std::vector<PoseObservation<double>> same(30, observations[0]);
  for (auto& o : same) o.depth = 0;
  const auto degenerate = optimize_pose<double>(test::kFreiburg3, same, true_pose(), {}, kernel, workspace);
  CHECK(degenerate.status == PoseStatus::degenerate);
  CHECK(degenerate.covariance.isZero());
  const SE3d turned(SO3d::exp(Eigen::Vector3d(0, 3.14, 0)), Eigen::Vector3d::Zero());
  CHECK_FALSE(optimize_pose<double>(test::kFreiburg3, observations, turned, {}, kernel, workspace).ok());
  for (auto& o : observations) o.x.x() = std::nan("");
  CHECK_FALSE(optimize_pose<double>(test::kFreiburg3, observations, true_pose(), {}, kernel, workspace).ok());
}

TEST_CASE(
    "pixel noise that was stated four times too large is noticed: moving objects nearby are outliers again") {
  test::Rng rng("pixel scale");
  auto observations = observe<double>(rng, 300, 0, 0.25, 0.01);
  for (auto& o : observations) o.inv_sigma_px2 = 1;  // true: 16
  for (std::size_t i = 0; i < 60; ++i)
    observations[i].x += Eigen::Vector2d(1.8, 0);  // within 2.4 px, but no noise
  PoseWorkspace<double> workspace;
  PoseOptions<double> options;
  const auto trusting = optimize_pose<double>(test::kFreiburg3, observations, true_pose(), options,
                                              TDistribution<double>::with_dimension(5, 1), workspace);
  options.min_pixel_scale = 0.2;
  const auto estimating = optimize_pose<double>(test::kFreiburg3, observations, true_pose(), options,
                                                TDistribution<double>::with_dimension(5, 1), workspace);
  CHECK(estimating.inliers < 250);
  CHECK(trusting.inliers > 280);
  CHECK(error(estimating.T_c_w) < 0.5 * error(trusting.T_c_w));
}

TEST_CASE_TEMPLATE("flags, weights, inliers and status agree on every path: a failed pose has no inliers", S,
                   float, double) {
  test::Rng rng("pose agreement");
  const auto kernel = TDistribution<S>::with_dimension(S(5), 1);
  PoseWorkspace<S> workspace;
  int failures = 0;
  const auto check = [&](const std::vector<PoseObservation<S>>& observations, const SE3<S>& start,
                         PoseStatus expected, const PoseOptions<S>& options = {}) {
    const auto result =
        optimize_pose<S>(test::kFreiburg3.cast<S>(), observations, start, options, kernel, workspace);
    CHECK(result.status == expected);
    REQUIRE(workspace.inlier.size() == observations.size());
    REQUIRE(workspace.weight.size() == observations.size());
    CHECK(std::count(workspace.inlier.begin(), workspace.inlier.end(), std::uint8_t{1}) == result.inliers);
    if (result.ok()) {
      CHECK(result.inliers >= options.min_observations);
      return;
    }
    ++failures;
    CHECK(result.inliers == 0);
    CHECK(result.cost == S(0));
    CHECK(result.covariance.isZero());
    CHECK(std::count(workspace.weight.begin(), workspace.weight.end(), S(0)) ==
          static_cast<std::ptrdiff_t>(observations.size()));
  };
  const SE3<S> truth = true_pose().cast<S>();
  auto good = observe<S>(rng, 30, 0, 1.0, 0.02);
  check(good, truth, PoseStatus::converged);
  auto five = good;
  five.resize(5);
  check(five, truth, PoseStatus::too_few_observations);
  check({}, truth, PoseStatus::too_few_observations);
  std::vector<PoseObservation<S>> same(30, good[0]);
  for (auto& o : same) o.depth = S(0);
  check(same, truth, PoseStatus::degenerate);
  auto scattered = good;  // matches that agree on nothing
  for (auto& o : scattered)
    o.x += Eigen::Matrix<S, 2, 1>(S(rng.uniform(-300, 300)), S(rng.uniform(-300, 300)));
  check(scattered, truth, PoseStatus::too_few_observations);
  auto nan = good;
  for (auto& o : nan) o.x.x() = std::numeric_limits<S>::quiet_NaN();
  check(nan, truth, PoseStatus::degenerate);
  CHECK(failures == 5);
}
