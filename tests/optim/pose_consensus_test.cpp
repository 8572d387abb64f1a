// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/optim/pose_consensus.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <vector>

#include "random.hpp"

using namespace dynslam;

namespace {

const Pinhole<double> kCamera(525, 525, 319.5, 239.5);

/// A room three to five metres away seen by a camera that moved by `T`, and a box of the given number
/// of points at arm's length that moved by its own.
std::vector<PoseObservation<double>> room_and_box(test::Rng& rng, const SE3d& T, int room, int box,
                                                  const Eigen::Vector3d& moved = {0.035, 0.004, 0.01}) {
  std::vector<PoseObservation<double>> all;
  for (int i = 0; i < room + box; ++i) {
    const bool near = i >= room;
    const Eigen::Vector2d x = near ? Eigen::Vector2d(rng.uniform(60, 260), rng.uniform(250, 420))
                                   : Eigen::Vector2d(rng.uniform(10, 630), rng.uniform(10, 470));
    const double z = near ? rng.uniform(1.1, 1.4) : rng.uniform(3, 5);
    PoseObservation<double> o;
    o.p_w = kCamera.ray(x) * z;
    const Eigen::Vector3d p_c = T * (near ? Eigen::Vector3d(o.p_w + moved) : o.p_w);
    o.x = *kCamera.project(p_c) + 0.2 * Eigen::Vector2d(rng.normal(), rng.normal());
    const double sigma = 0.004 + 0.008 * z * z;
    o.depth = p_c.z() + 0.5 * sigma * rng.normal();
    o.inv_sigma_px2 = 1 / (0.5 * 0.5);
    o.inv_sigma_z2 = 1 / (sigma * sigma);
    all.push_back(o);
  }
  return all;
}

}  // namespace

TEST_CASE("the room wins over a carried box; the robust kernel alone compromises") {
  test::Rng rng("consensus");
  Eigen::Matrix<double, 6, 1> xi;
  xi << 0.01, -0.004, 0.012, 0.003, -0.006, 0.002;
  const SE3d T = SE3d::exp(xi);
  double worst = 0, worst_kernel = 0;
  for (int trial = 0; trial < 20; ++trial) {
    const auto observations = room_and_box(rng, T, 220, 90);
    const SE3d still;
    PoseConsensusOptions<double> options;
    options.seed = static_cast<std::uint64_t>(trial);
    const auto found = pose_consensus<double>(kCamera, observations, still, {}, options);
    CHECK(found.inliers > 150);
    worst = std::max(worst, (found.T_c_w * T.inverse()).translation().norm());
    PoseWorkspace<double> workspace;
    const auto kernel =
        optimize_pose<double>(kCamera, observations, still, {}, TDistribution<double>(5), workspace);
    worst_kernel = std::max(worst_kernel, (kernel.T_c_w * T.inverse()).translation().norm());
  }
  CHECK(worst < 0.012);
  CHECK(worst_kernel > 0.015);  // what this header is for
}

TEST_CASE("a poster with most of the features loses against the room behind it, by surface") {
  test::Rng rng("consensus surface");
  Eigen::Matrix<double, 6, 1> xi;
  xi << 0.01, -0.004, 0.012, 0.003, -0.006, 0.002;
  const SE3d T = SE3d::exp(xi), still;
  SurfaceOptions<double> surface;
  int by_number = 0;
  for (int trial = 0; trial < 20; ++trial) {
    const auto observations = room_and_box(rng, T, 90, 220);
    PoseConsensusOptions<double> options;
    options.seed = static_cast<std::uint64_t>(trial);
    std::vector<double> weights;
    surface_weights<double>(still, observations, surface, weights);
    const auto found = pose_consensus<double>(kCamera, observations, still, {}, options, weights);
    CHECK((found.T_c_w * T.inverse()).translation().norm() < 0.012);
    const auto counted = pose_consensus<double>(kCamera, observations, still, {}, options);
    by_number += (counted.T_c_w * T.inverse()).translation().norm() < 0.012 ? 1 : 0;
  }
  CHECK(by_number == 0);  // features alone follow the poster
}

TEST_CASE("a leap that a few more matches speak for is not believed, one that most speak for is") {
  test::Rng rng("consensus prior");
  Eigen::Matrix<double, 6, 1> xi;
  xi << 0.01, -0.004, 0.012, 0.003, -0.006, 0.002;
  const SE3d T = SE3d::exp(xi), still;
  const Eigen::Vector3d leap(0.25, 0.1, 0.0);
  PoseConsensusOptions<double> free, prior;
  prior.prior_share = 0.3;
  int believed = 0;
  for (int trial = 0; trial < 20; ++trial) {
    free.seed = prior.seed = static_cast<std::uint64_t>(trial);
    const auto error = [&](const auto& observations, const PoseConsensusOptions<double>& options) {
      const auto found = pose_consensus<double>(kCamera, observations, still, {}, options);
      return (found.T_c_w * T.inverse()).translation().norm();
    };
    const auto doubtful = room_and_box(rng, T, 60, 70, leap);
    believed += error(doubtful, free) > 0.1 ? 1 : 0;
    CHECK(error(doubtful, prior) < 0.012);
    CHECK(error(room_and_box(rng, T, 60, 200, leap), prior) > 0.2);
  }
  CHECK(believed > 15);
}

TEST_CASE("surface weights are the places to which an observation is nearest, times their depth") {
  test::Rng rng("surface weights");
  std::vector<PoseObservation<double>> observations;
  for (int k = 0; k < 40; ++k) {
    PoseObservation<double> o;
    o.x = Eigen::Vector2d(rng.uniform(0, 300), rng.uniform(0, 480));  // none in the right half
    o.depth = k % 4 == 0 ? 0.0 : rng.uniform(0.5, 8.0);
    o.p_w = kCamera.ray(o.x) * (k % 4 == 0 ? 2.0 : o.depth);
    observations.push_back(o);
  }
  SurfaceOptions<double> options;
  std::vector<double> weights;
  surface_weights<double>(SE3d(), observations, options, weights);
  std::vector<double> places(observations.size(), 0.25);
  int free = 0;
  for (int v = 10; v < 480; v += 20) {
    for (int u = 10; u < 640; u += 20) {
      std::size_t best = 0;
      const auto distance = [&](std::size_t k) { return (observations[k].x - Eigen::Vector2d(u, v)).norm(); };
      for (std::size_t k = 1; k < observations.size(); ++k) best = distance(k) < distance(best) ? k : best;
      if (distance(best) < 100) {
        places[best] += 1;
      } else {
        ++free;
      }
    }
  }
  CHECK(free > 200);
  for (std::size_t k = 0; k < observations.size(); ++k) {
    CAPTURE(k);
    CHECK(weights[k] == doctest::Approx(places[k] * std::min(4.0, observations[k].p_w.z())));
  }
  surface_weights<double>(SE3d(), {}, options, weights);
  CHECK(weights.empty());
}

TEST_CASE(
    "the same seed gives the same pose; a good alternative is taken; few observations keep the prediction") {
  test::Rng rng("consensus seeds");
  Eigen::Matrix<double, 6, 1> xi;
  xi << 0.2, 0, 0.1, 0, 0.1, 0;
  const SE3d T = SE3d::exp(xi), still;
  auto observations = room_and_box(rng, T, 100, 30);
  const auto a = pose_consensus<double>(kCamera, observations, still, {});
  const auto b = pose_consensus<double>(kCamera, observations, still, {});
  CHECK(a.T_c_w.translation() == b.T_c_w.translation());
  PoseConsensusOptions<double> none;
  none.hypotheses = 0;
  const auto told = pose_consensus<double>(kCamera, observations, still, std::span<const SE3d>(&T, 1), none);
  CHECK((told.T_c_w * T.inverse()).log().norm() < 1e-12);
  observations.resize(2);
  const auto few = pose_consensus<double>(kCamera, observations, still, {});
  CHECK(few.T_c_w.translation().norm() == 0);
  CHECK(pose_consensus<double>(kCamera, {}, still, {}).inliers == 0);
}
