// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/optim/absolute_pose.hpp"

#include <doctest/doctest.h>

#include <vector>

#include "dynslam/geometry/pinhole.hpp"
#include "random.hpp"
#include "tum_cameras.hpp"

using namespace dynslam;

namespace {

template <class S>
std::vector<PoseObservation<S>> matches(test::Rng& rng, const SE3d& T_c_w, int good, int wrong,
                                        bool depth = true) {
  std::vector<PoseObservation<S>> all;
  for (int k = 0; k < good + wrong; ++k) {
    const Eigen::Vector2d x(rng.uniform(0, 640), rng.uniform(0, 480));
    const double z = rng.uniform(1, 4), sigma = 0.004 + 0.008 * z * z;
    Eigen::Vector3d p_w = T_c_w.inverse() * Eigen::Vector3d(test::kFreiburg3.ray(x) * z);
    if (k >= good) p_w = Eigen::Vector3d(rng.uniform(-2, 2), rng.uniform(-2, 2), rng.uniform(0, 4));
    const Eigen::Vector2d seen = x + Eigen::Vector2d(rng.normal(), rng.normal());
    PoseObservation<S> o;
    o.p_w = p_w.cast<S>();
    o.x = seen.cast<S>();
    if (depth) {
      o.depth = static_cast<S>(z + sigma * rng.normal());
      o.inv_sigma_z2 = static_cast<S>(1 / (sigma * sigma));
    }
    all.push_back(o);
  }
  return all;
}

}  // namespace

TEST_CASE_TEMPLATE("the pose is found from scratch among four wrong matches in five", S, float, double) {
  test::Rng rng("absolute pose");
  AbsolutePoseWorkspace ws;
  AbsolutePoseOptions<S> options;
  options.hypotheses = 2000;
  for (int trial = 0; trial < 20; ++trial) {
    SE3d::Vector6 xi;
    for (int i = 0; i < 6; ++i) xi(i) = rng.uniform(-1.5, 1.5);
    const SE3d truth = SE3d::exp(xi);
    const auto all = matches<S>(rng, truth, 40, 160);
    const auto found = absolute_pose<S>(test::kFreiburg3.cast<S>(), all, options, ws);
    REQUIRE(found.ok());
    CHECK(found.inliers >= 15);
    const SE3d error = found.T_c_w.template cast<double>() * truth.inverse();
    CHECK(error.translation().norm() < 0.1);
    CHECK(error.so3().log().norm() < 0.05);
    const auto again = absolute_pose<S>(test::kFreiburg3.cast<S>(), all, options, ws);
    CHECK(again.T_c_w.matrix() == found.T_c_w.matrix());
    options.seed += 1;
  }
}

TEST_CASE_TEMPLATE("fewer samples do where most matches are right", S, float, double) {
  test::Rng rng("absolute pose early");
  AbsolutePoseWorkspace ws;
  const auto found = absolute_pose<S>(test::kFreiburg3.cast<S>(), matches<S>(rng, SE3d(), 95, 5), {}, ws);
  CHECK(found.ok());
  CHECK(found.hypotheses < 40);
}

TEST_CASE_TEMPLATE("pixels alone give the pose, among seven wrong matches in ten", S, float, double) {
  test::Rng rng("absolute pose of pixels");
  AbsolutePoseWorkspace ws;
  AbsolutePoseOptions<S> options;
  options.hypotheses = 1000;
  for (int trial = 0; trial < 20; ++trial) {
    SE3d::Vector6 xi;
    for (int i = 0; i < 6; ++i) xi(i) = rng.uniform(-1.5, 1.5);
    const SE3d truth = SE3d::exp(xi);
    auto all = matches<S>(rng, truth, 60, 140, false);
    // A few with depth, all in one corner, do not keep the others from being sampled.
    if (trial % 2 == 1) {
      for (std::size_t k = 0; k < 4; ++k) {
        all[k].depth = (truth.cast<S>() * all[k].p_w).z();
        all[k].inv_sigma_z2 = S(100);
      }
    }
    const auto found = absolute_pose<S>(test::kFreiburg3.cast<S>(), all, options, ws);
    REQUIRE(found.ok());
    CHECK(found.inliers >= 55);
    const SE3d error = found.T_c_w.template cast<double>() * truth.inverse();
    CHECK(error.translation().norm() < 0.03);
    CHECK(error.so3().log().norm() < 0.01);
    options.seed += 1;
  }
}

TEST_CASE("a refined pose has the error of least squares, with depth and without") {
  test::Rng rng("absolute pose refined");
  AbsolutePoseWorkspace ws;
  for (const bool depth : {true, false}) {
    double refined = 0, sampled = 0;
    for (int trial = 0; trial < 30; ++trial) {
      const auto all = matches<double>(rng, SE3d(), 200, 100, depth);
      AbsolutePoseOptions<double> options;
      refined += absolute_pose<double>(test::kFreiburg3, all, options, ws).T_c_w.log().norm() / 30;
      options.refinements = 0;
      sampled += absolute_pose<double>(test::kFreiburg3, all, options, ws).T_c_w.log().norm() / 30;
    }
    CAPTURE(depth);
    CHECK(refined < 0.004);
    CHECK(refined < 0.5 * sampled);
  }
}

TEST_CASE_TEMPLATE("nothing is claimed without three points", S, float, double) {
  test::Rng rng("absolute pose nothing");
  AbsolutePoseWorkspace ws;
  for (const bool depth : {true, false}) {
    CHECK_FALSE(
        absolute_pose<S>(test::kFreiburg3.cast<S>(), matches<S>(rng, SE3d(), 2, 0, depth), {}, ws).ok());
    CHECK(absolute_pose<S>(test::kFreiburg3.cast<S>(), matches<S>(rng, SE3d(), 2, 0, depth)).status ==
          AbsolutePoseStatus::too_few_observations);
    // A hundred wrong matches agree on next to nothing.
    CHECK(
        absolute_pose<S>(test::kFreiburg3.cast<S>(), matches<S>(rng, SE3d(), 0, 100, depth), {}, ws).inliers <
        12);
  }
}
