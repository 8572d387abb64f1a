// SPDX-License-Identifier: BSD-3-Clause
#include "ceres_bundle.hpp"  // first: see there

#include "dynslam/optim/bundle_adjustment.hpp"

#include <algorithm>
#include <vector>

#include "random.hpp"

using namespace dynslam;

namespace {

const Pinhole<double> kCamera(535.4, 539.2, 320.1, 247.6);

/// A window as a tracker leaves it: poses and points off by some centimetres, noisy sights, a few of them
/// wrong.
struct Window {
  std::vector<SE3d> truth, poses;
  std::vector<std::uint8_t> fixed;
  std::vector<Eigen::Vector3d> points_truth, points;
  std::vector<BundleObservation<double>> observations;

  [[nodiscard]] BundleProblem<double> problem() { return {poses, fixed, points, observations}; }
  [[nodiscard]] double pose_error() const {
    double worst = 0;
    for (std::size_t i = 0; i < poses.size(); ++i)
      worst = std::max(worst, (poses[i] * truth[i].inverse()).log().norm());
    return worst;
  }
};

Window make_window(test::Rng& rng, int poses, int points, double wrong, bool noise = true) {
  Window w;
  for (int i = 0; i < poses; ++i) {
    Eigen::Matrix<double, 6, 1> xi;
    for (int k = 0; k < 6; ++k) xi(k) = rng.uniform(-1, 1) * (k < 3 ? 0.3 : 0.15);
    w.truth.push_back(SE3d::exp(xi));
    w.fixed.push_back(i < 2 ? 1 : 0);
    for (int k = 0; k < 6; ++k) xi(k) = i < 2 ? 0 : rng.normal() * 0.01;
    w.poses.push_back(SE3d::exp(xi) * w.truth.back());
  }
  for (int j = 0; j < points; ++j) {
    w.points_truth.emplace_back(rng.uniform(-2, 2), rng.uniform(-1.5, 1.5), rng.uniform(1.5, 5));
    w.points.push_back(w.points_truth.back() +
                       0.03 * Eigen::Vector3d(rng.normal(), rng.normal(), rng.normal()));
    for (int i = 0; i < poses; ++i) {
      const Eigen::Vector3d p_c = w.truth[static_cast<std::size_t>(i)] * w.points_truth.back();
      const auto x = kCamera.project(p_c);
      if (!x || x->x() < 0 || x->y() < 0 || x->x() > 639 || x->y() > 479 || rng.chance(0.3)) continue;
      BundleObservation<double> o;
      const double sigma_z = 0.004 + 0.008 * p_c.z() * p_c.z(), size = noise ? 1 : 0;
      o.pose = i;
      o.point = j;
      o.x = *x + size * 0.5 * Eigen::Vector2d(rng.normal(), rng.normal());
      if (rng.chance(wrong)) o.x += Eigen::Vector2d(rng.uniform(-40, 40), rng.uniform(-40, 40));
      o.depth = rng.chance(0.2) ? 0 : p_c.z() + size * sigma_z * rng.normal();  // holes in the depth image
      o.inv_sigma_px2 = 4;
      o.inv_sigma_z2 = 1 / (sigma_z * sigma_z);
      w.observations.push_back(o);
    }
  }
  return w;
}

}  // namespace

TEST_CASE("without noise the window is restored to rounding") {
  test::Rng rng("bundle exact");
  Window w = make_window(rng, 6, 200, 0, false);
  BundleWorkspace<double> workspace;
  BundleOptions<double> options;
  options.max_iterations = 40;
  options.tolerance = 1e-16;
  const auto result =
      bundle_adjust<double>(kCamera, w.problem(), options, TDistribution<double>(5), workspace);
  CHECK(result.ok());
  CHECK(result.final_cost < 1e-12 * result.initial_cost);
  CHECK(w.pose_error() < 1e-7);
}

#ifdef DYNSLAM_HAVE_CERES
TEST_CASE("the final cost is Ceres' on the same windows") {
  test::Rng rng("bundle ceres");
  for (int trial = 0; trial < 4; ++trial) {
    CAPTURE(trial);
    Window w = make_window(rng, 6 + 2 * trial, 150, 0.05);
    const double oracle = test::ceres_bundle_cost(kCamera, w.problem(), 5);
    BundleWorkspace<double> workspace;
    BundleOptions<double> options;
    options.max_iterations = 100;
    options.tolerance = 1e-12;
    const auto result =
        bundle_adjust<double>(kCamera, w.problem(), options, TDistribution<double>(5), workspace);
    CHECK(result.status == BundleStatus::converged);
    CHECK(result.final_cost == doctest::Approx(oracle).epsilon(1e-6));
    CHECK(w.pose_error() < 0.01);
  }
}
#else
TEST_CASE("the final cost is Ceres' on the same windows") {
  MESSAGE("skipped: built without Ceres");
}
#endif

TEST_CASE("fixed poses do not move, unobserved points stay, the status is honest") {
  test::Rng rng("bundle status");
  Window w = make_window(rng, 5, 80, 0.02);
  w.points.emplace_back(9, 9, 9);  // nobody sees it
  const Window before = w;
  BundleWorkspace<double> workspace;
  BundleOptions<double> one;
  one.max_iterations = 1;
  const auto result = bundle_adjust<double>(kCamera, w.problem(), one, TDistribution<double>(5), workspace);
  CHECK(result.status == BundleStatus::max_iterations);
  CHECK(result.final_cost < result.initial_cost);
  CHECK(w.poses[0].matrix() == before.poses[0].matrix());
  CHECK(w.points.back() == before.points.back());

  Window all_free = before;
  std::fill(all_free.fixed.begin(), all_free.fixed.end(), std::uint8_t{0});
  CHECK(bundle_adjust<double>(kCamera, all_free.problem(), {}, TDistribution<double>(5), workspace).status ==
        BundleStatus::no_gauge);
  Window all_fixed = before;
  std::fill(all_fixed.fixed.begin(), all_fixed.fixed.end(), std::uint8_t{1});
  CHECK(bundle_adjust<double>(kCamera, all_fixed.problem(), {}, TDistribution<double>(5), workspace).status ==
        BundleStatus::no_free_pose);
  Window unsorted = before;
  std::swap(unsorted.observations.front(), unsorted.observations.back());
  CHECK(bundle_adjust<double>(kCamera, unsorted.problem(), {}, TDistribution<double>(5), workspace).status ==
        BundleStatus::bad_input);
  Window nan = before;
  nan.observations[0].x.x() = std::nan("");
  CHECK(bundle_adjust<double>(kCamera, nan.problem(), {}, TDistribution<double>(5), workspace).status ==
        BundleStatus::bad_input);
}

TEST_CASE("nothing is allocated once the workspace is warm: the same result from a reused one") {
  test::Rng rng("bundle reuse");
  Window w = make_window(rng, 6, 100, 0.05), small = make_window(rng, 4, 30, 0);
  Window again = w;
  BundleWorkspace<double> workspace;
  (void)bundle_adjust<double>(kCamera, w.problem(), {}, TDistribution<double>(5), workspace);
  (void)bundle_adjust<double>(kCamera, small.problem(), {}, TDistribution<double>(5), workspace);
  (void)bundle_adjust<double>(kCamera, again.problem(), {}, TDistribution<double>(5), workspace);
  for (std::size_t i = 0; i < w.poses.size(); ++i)
    CHECK(w.poses[i].translation() == again.poses[i].translation());
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
  const auto result =
      bundle_adjust<float>(kCamera.cast<float>(), problem, {}, TDistribution<float>(5), workspace);
  CHECK(result.ok());
  double worst = 0;
  for (std::size_t i = 0; i < poses.size(); ++i)
    worst = std::max(worst, (poses[i].cast<double>() * w.truth[i].inverse()).log().norm());
  CHECK(worst < 0.01);
}
