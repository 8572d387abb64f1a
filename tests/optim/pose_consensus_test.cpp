// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/optim/pose_consensus.hpp"

#include <doctest/doctest.h>

#include <vector>

#include "random.hpp"

using namespace dynslam;

namespace {

const Pinhole<double> kCamera(525, 525, 319.5, 239.5);

/// A room three to five metres away seen by a camera that moved by `T`, and a box of the given number
/// of points at arm's length that moved by its own.
std::vector<PoseObservation<double>> room_and_box(test::Rng& rng, const SE3d& T, int room, int box) {
  std::vector<PoseObservation<double>> all;
  for (int i = 0; i < room + box; ++i) {
    const bool near = i >= room;
    const Eigen::Vector2d x = near ? Eigen::Vector2d(rng.uniform(60, 260), rng.uniform(250, 420))
                                   : Eigen::Vector2d(rng.uniform(10, 630), rng.uniform(10, 470));
    const double z = near ? rng.uniform(1.1, 1.4) : rng.uniform(3, 5);
    PoseObservation<double> o;
    o.p_w = kCamera.unproject(x, z);
    const Eigen::Vector3d p_c =
        T * (near ? Eigen::Vector3d(o.p_w + Eigen::Vector3d(0.035, 0.004, 0.01)) : o.p_w);
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
  observations.resize(3);
  const auto few = pose_consensus<double>(kCamera, observations, still, {});
  CHECK(few.T_c_w.translation().norm() == 0);
  CHECK(pose_consensus<double>(kCamera, {}, still, {}).inliers == 0);
}
