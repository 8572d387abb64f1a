// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/optim/bundle_adjustment.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "bundle_window.hpp"
#include "dynslam/robust/kernels.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

using test::make_window;
using test::Window;

}  // namespace

TEST_CASE("without noise the window is restored to rounding") {
  test::Rng rng("bundle exact");
  Window w = make_window(rng, 6, 200, 0, false);
  BundleWorkspace<double> workspace;
  BundleOptions<double> options;
  options.max_iterations = 40;
  options.tolerance = 1e-16;
  const auto result = bundle_adjust<double>(test::kFreiburg3, w.problem(), options,
                                            TDistribution<double>::with_dimension(5, 1), workspace);
  CHECK(result.ok());
  CHECK(result.final_cost < 1e-12 * result.initial_cost);
  CHECK(w.pose_error() < 1e-7);
}

TEST_CASE("fixed poses do not move, unobserved points stay, the status is honest") {
  test::Rng rng("bundle status");
  Window w = make_window(rng, 5, 80, 0.02);
  w.points.emplace_back(9, 9, 9);  // nobody sees it
  const Window before = w;
  BundleWorkspace<double> workspace;
  BundleOptions<double> one;
  one.max_iterations = 1;
  const auto result = bundle_adjust<double>(test::kFreiburg3, w.problem(), one,
                                            TDistribution<double>::with_dimension(5, 1), workspace);
  CHECK(result.status == BundleStatus::max_iterations);
  CHECK(result.final_cost < result.initial_cost);
  CHECK(w.poses[0].matrix() == before.poses[0].matrix());
  CHECK(w.points.back() == before.points.back());

  Window all_free = before;
  std::fill(all_free.fixed.begin(), all_free.fixed.end(), std::uint8_t{0});
  CHECK(bundle_adjust<double>(test::kFreiburg3, all_free.problem(), {},
                              TDistribution<double>::with_dimension(5, 1), workspace)
            .status == BundleStatus::no_gauge);
  Window all_fixed = before;
  std::fill(all_fixed.fixed.begin(), all_fixed.fixed.end(), std::uint8_t{1});
  CHECK(bundle_adjust<double>(test::kFreiburg3, all_fixed.problem(), {},
                              TDistribution<double>::with_dimension(5, 1), workspace)
            .status == BundleStatus::no_free_pose);
  Window unsorted = before;
  std::swap(unsorted.observations.front(), unsorted.observations.back());
  CHECK(bundle_adjust<double>(test::kFreiburg3, unsorted.problem(), {},
                              TDistribution<double>::with_dimension(5, 1), workspace)
            .status == BundleStatus::bad_input);
  Window nan = before;
  nan.observations[0].x.x() = std::nan("");
  nan.points[0] = Eigen::Vector3d(0, 0, -3);  // also where it does not count yet
  CHECK(bundle_adjust<double>(test::kFreiburg3, nan.problem(), {},
                              TDistribution<double>::with_dimension(5, 1), workspace)
            .status == BundleStatus::bad_input);
}

TEST_CASE("a reused workspace gives the same result") {
  test::Rng rng("bundle reuse");
  Window w = make_window(rng, 6, 100, 0.05), small = make_window(rng, 4, 30, 0);
  Window again = w;
  BundleWorkspace<double> workspace;
  (void)bundle_adjust<double>(test::kFreiburg3, w.problem(), {}, TDistribution<double>::with_dimension(5, 1),
                              workspace);
  (void)bundle_adjust<double>(test::kFreiburg3, small.problem(), {},
                              TDistribution<double>::with_dimension(5, 1), workspace);
  (void)bundle_adjust<double>(test::kFreiburg3, again.problem(), {},
                              TDistribution<double>::with_dimension(5, 1), workspace);
  for (std::size_t i = 0; i < w.poses.size(); ++i)
    CHECK(w.poses[i].translation() == again.poses[i].translation());
}

namespace {

/// Two views of one scene, the second far from where it is thought to be and nearly nothing measured but
/// pixels: hiding points behind the cameras would be the cheapest way out.
Window two_views(test::Rng& rng) {
  Window w;
  Eigen::Matrix<double, 6, 1> xi;
  xi << 0.3, 0.05, 0.1, 0.02, -0.1, 0.03;
  w.truth = {SE3d(), SE3d::exp(xi)};
  xi << -0.4, 0.3, -1.4, 0.2, 0.5, -0.3;
  w.poses = {SE3d(), SE3d::exp(xi) * w.truth[1]};
  w.fixed = {1, 0};
  while (w.points.size() < 1200) {
    const Eigen::Vector3d p(rng.uniform(-1.5, 1.5), rng.uniform(-1, 1), rng.uniform(1, 4));
    const Eigen::Vector3d off = p + 0.1 * Eigen::Vector3d(rng.normal(), rng.normal(), rng.normal());
    if (std::min({(w.poses[1] * off).z(), (w.truth[1] * p).z(), off.z()}) < 0.05) continue;
    for (int i = 0; i < 2; ++i) {
      BundleObservation<double> o;
      o.pose = i;
      o.point = static_cast<int>(w.points.size());
      o.x = *test::kFreiburg3.project(w.truth[static_cast<std::size_t>(i)] * p) +
            Eigen::Vector2d(rng.normal(), rng.normal());
      w.observations.push_back(o);
    }
    w.points_truth.push_back(p);
    w.points.push_back(off);
  }
  return w;
}

/// One sight of a point of its own that is behind the camera it is said to be seen by.
void add_sight_behind(Window& w, int pose) {
  BundleObservation<double> o;
  o.pose = pose;
  o.point = static_cast<int>(w.points.size());
  o.x = Eigen::Vector2d(300, 200);
  w.points.push_back(w.poses[static_cast<std::size_t>(pose)].inverse() * Eigen::Vector3d(0.1, 0.2, -2));
  w.observations.push_back(o);
}

int hidden(const Window& w, std::size_t count) {
  int n = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const auto& o = w.observations[k];
    n += test::kFreiburg3.project(w.poses[static_cast<std::size_t>(o.pose)] *
                                  w.points[static_cast<std::size_t>(o.point)])
             ? 0
             : 1;
  }
  return n;
}

}  // namespace

TEST_CASE("two views with one unrelated sight behind a camera: no other point may be hidden") {
  test::Rng rng("bundle hidden");
  for (const int pose : {0, 1}) {
    CAPTURE(pose);
    Window w = two_views(rng);
    const std::size_t count = w.observations.size();
    REQUIRE(hidden(w, count) == 0);
    add_sight_behind(w, pose);
    BundleWorkspace<double> workspace;
    BundleOptions<double> options;
    options.max_iterations = 50;
    const auto result = bundle_adjust<double>(test::kFreiburg3, w.problem(), options,
                                              TDistribution<double>::with_dimension(5, 1), workspace);
    CHECK(result.ok());
    CHECK(hidden(w, count) == 0);
  }
}

TEST_CASE("a sight behind its camera changes nothing for the others") {
  test::Rng rng("bundle unrelated");
  Window w = make_window(rng, 6, 100, 0.05), with = w;
  add_sight_behind(with, 3);
  BundleWorkspace<double> workspace;
  const auto a = bundle_adjust<double>(test::kFreiburg3, w.problem(), {},
                                       TDistribution<double>::with_dimension(5, 1), workspace);
  const auto b = bundle_adjust<double>(test::kFreiburg3, with.problem(), {},
                                       TDistribution<double>::with_dimension(5, 1), workspace);
  CHECK(a.status == b.status);
  CHECK(a.initial_cost == b.initial_cost);
  CHECK(a.final_cost == b.final_cost);
  for (std::size_t i = 0; i < w.poses.size(); ++i) CHECK(w.poses[i].matrix() == with.poses[i].matrix());
}

TEST_CASE("a sight that comes in front of its camera counts from then on") {
  test::Rng rng("bundle in front");
  Window w = make_window(rng, 4, 100, 0, false);
  // The last camera is thought to stand before the nearest points, which it sees.
  w.poses[3] = SE3d(SO3d(), Eigen::Vector3d(0, 0, -2.5)) * w.truth[3];
  const int before = hidden(w, w.observations.size());
  REQUIRE(before > 0);
  REQUIRE(before < 60);
  BundleWorkspace<double> workspace;
  BundleOptions<double> options;
  options.max_iterations = 100;
  options.tolerance = 1e-16;
  const auto result =
      bundle_adjust<double>(test::kFreiburg3, w.problem(), options, SquaredLoss<double>{}, workspace);
  CHECK(result.ok());
  CHECK(hidden(w, w.observations.size()) == 0);
  CHECK(result.final_cost < 1e-9 * result.initial_cost);
  CHECK(w.pose_error() < 1e-5);
}

TEST_CASE("in float, a window improves as in double") {
  test::Rng rng("bundle float");
  Window w = make_window(rng, 6, 150, 0.02);
  std::vector<SE3<float>> poses;
  std::vector<Eigen::Vector3f> points;
  std::vector<BundleObservation<float>> observations;
  for (const auto& T : w.poses) poses.push_back(T.cast<float>());
  for (const auto& p : w.points) points.push_back(p.cast<float>());
  for (const auto& o : w.observations) {
    observations.push_back({o.pose, o.point, o.x.cast<float>(), static_cast<float>(o.depth),
                            static_cast<float>(o.inv_sigma_px2), static_cast<float>(o.inv_sigma_z2)});
  }
  BundleWorkspace<float> workspace;
  const BundleProblem<float> problem{poses, w.fixed, points, observations};
  const auto result = bundle_adjust<float>(test::kFreiburg3.cast<float>(), problem, {},
                                           TDistribution<float>::with_dimension(5, 1), workspace);
  CHECK(result.ok());
  double worst = 0;
  for (std::size_t i = 0; i < poses.size(); ++i)
    worst = std::max(worst, (poses[i].cast<double>() * w.truth[i].inverse()).log().norm());
  CHECK(worst < 0.01);
}
