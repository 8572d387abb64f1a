// SPDX-License-Identifier: BSD-3-Clause
// Pose, consensus, absolute pose and bundle adjustment take any camera.
#include <doctest/doctest.h>

#include <cmath>
#include <concepts>
#include <cstdint>
#include <vector>

#include "dynslam/geometry/brown_conrady.hpp"
#include "dynslam/geometry/kannala_brandt.hpp"
#include "dynslam/optim/absolute_pose.hpp"
#include "dynslam/optim/bundle_adjustment.hpp"
#include "dynslam/optim/pose.hpp"
#include "dynslam/optim/pose_consensus.hpp"
#include "random.hpp"
#include "test_cameras.hpp"
#include "tum_cameras.hpp"

using namespace dynslam;

namespace {

template <class Camera>
Camera make() {
  using S = typename Camera::ScalarType;
  if constexpr (std::same_as<Camera, Pinhole<S>>) {
    return test::kFreiburg3.cast<S>();
  } else if constexpr (std::same_as<Camera, PinholeBrownConrady<S>>) {
    return PinholeBrownConrady<S>(test::kFreiburg3.cast<S>(),
                                  BrownConrady<S>(S(-0.2), S(0.05), S(0.001), S(-0.002), S(0)));
  } else if constexpr (std::same_as<Camera, KannalaBrandt<S>>) {
    return KannalaBrandt<S>(S(330), S(332), S(320), S(240),
                            Eigen::Matrix<S, 4, 1>(S(-0.02), S(0.005), S(-0.002), S(0.0003)));
  } else {
    return Camera(S(260), S(320), S(240));
  }
}

SE3d true_pose() {
  Eigen::Matrix<double, 6, 1> xi;
  xi << 0.3, -0.2, 0.1, 0.15, -0.1, 0.2;
  return SE3d::exp(xi);
}
SE3d nearby(const SE3d& T, double metres) {
  Eigen::Matrix<double, 6, 1> xi;
  xi << metres, -metres, metres, 0.3 * metres, 0.2 * metres, -0.3 * metres;
  return SE3d::exp(xi) * T;
}

/// Points that the camera sees within 640 x 480 pixels; a share of the matches is wrong.
template <class Camera>
std::vector<PoseObservation<typename Camera::ScalarType>> sights(test::Rng& rng, const Camera& camera, int n,
                                                                 double wrong, double noise) {
  using S = typename Camera::ScalarType;
  std::vector<PoseObservation<S>> all;
  const SE3<S> T_w_c = true_pose().inverse().cast<S>();
  while (static_cast<int>(all.size()) < n) {
    PoseObservation<S> o;
    o.x = Eigen::Vector2d(rng.uniform(20, 620), rng.uniform(20, 460)).cast<S>();
    const double z = rng.uniform(1, 4);
    const auto p = camera.unproject(o.x, S(z));
    if (!p) continue;
    o.p_w = T_w_c * *p;
    o.x += (noise * Eigen::Vector2d(rng.normal(), rng.normal())).cast<S>();
    if (rng.chance(wrong)) o.x += Eigen::Vector2d(rng.uniform(20, 80), rng.uniform(-80, 80)).cast<S>();
    o.depth = static_cast<S>(z + 0.02 * noise * rng.normal());
    o.inv_sigma_px2 = S(1);
    o.inv_sigma_z2 = S(2500);
    all.push_back(o);
  }
  return all;
}

template <class S>
double error(const SE3<S>& T) {
  return (T.template cast<double>() * true_pose().inverse()).log().norm();
}

}  // namespace

// Each lens once, the scalars in turn. Every one with both is what tests/conformance runs.
#define CAMERAS Pinhole<float>, PinholeBrownConrady<double>, KannalaBrandt<float>, test::Panorama<double>

TEST_CASE_TEMPLATE("the pose is found with any camera", Camera, CAMERAS) {
  using S = typename Camera::ScalarType;
  test::Rng rng("pose any camera");
  const Camera camera = make<Camera>();
  const SE3<S> start = nearby(true_pose(), 0.05).template cast<S>();
  const auto exact = optimize_pose<S>(camera, sights(rng, camera, 200, 0, 0), start);
  CHECK(exact.ok());
  CHECK(exact.inliers == 200);
  CHECK(error(exact.T_c_w) < (std::same_as<S, float> ? 1e-4 : 1e-9));
  PoseWorkspace<S> workspace;
  const auto noisy = optimize_pose<S>(camera, sights(rng, camera, 300, 0.3, 0.5), start, {},
                                      TDistribution<S>::with_dimension(S(5), 1), workspace);
  CHECK(noisy.ok());
  CHECK(error(noisy.T_c_w) < 3e-3);
}

TEST_CASE_TEMPLATE("consensus and absolute pose are found with any camera", Camera, CAMERAS) {
  using S = typename Camera::ScalarType;
  test::Rng rng("consensus any camera");
  const Camera camera = make<Camera>();
  const auto observations = sights(rng, camera, 200, 0.4, 0.5);
  const auto consensus =
      pose_consensus<S>(camera, observations, nearby(true_pose(), 0.03).template cast<S>());
  CHECK(consensus.ok());
  CHECK(consensus.inliers > 90);
  CHECK(error(consensus.T_c_w) < 0.01);
  const auto absolute = absolute_pose<S>(camera, observations);
  CHECK(absolute.ok());
  CHECK(absolute.inliers > 90);
  CHECK(error(absolute.T_c_w) < 0.05);
}

TEST_CASE_TEMPLATE("absolute pose needs no derivative of the camera", S, float, double) {
  test::Rng rng("absolute plain camera");
  const test::Panorama<S> camera = make<test::Panorama<S>>();
  const auto observations = sights(rng, camera, 200, 0.4, 0.5);
  const auto without = absolute_pose<S>(test::PlainPanorama<S>(camera), observations);
  CHECK(without.ok());
  CHECK(error(without.T_c_w) < 0.05);
  AbsolutePoseOptions<S> unrefined;
  unrefined.refinements = 0;
  CHECK(without.T_c_w.matrix() == absolute_pose<S>(camera, observations, unrefined).T_c_w.matrix());
  CHECK(error(absolute_pose<S>(camera, observations).T_c_w) < error(without.T_c_w));
}

TEST_CASE_TEMPLATE("a window is adjusted with any camera", Camera, CAMERAS) {
  using S = typename Camera::ScalarType;
  test::Rng rng("bundle any camera");
  const Camera camera = make<Camera>();
  std::vector<SE3<S>> truth, poses;
  std::vector<std::uint8_t> fixed;
  for (int i = 0; i < 5; ++i) {
    Eigen::Matrix<double, 6, 1> xi;
    for (int k = 0; k < 6; ++k) xi(k) = rng.uniform(-1, 1) * (k < 3 ? 0.3 : 0.1);
    truth.push_back(SE3d::exp(xi).template cast<S>());
    fixed.push_back(i < 2 ? 1 : 0);
    poses.push_back(i < 2 ? truth.back() : nearby(SE3d::exp(xi), 0.02).template cast<S>());
  }
  std::vector<Eigen::Matrix<S, 3, 1>> points;
  std::vector<BundleObservation<S>> observations;
  for (int j = 0; j < 120; ++j) {
    const Eigen::Matrix<S, 3, 1> p =
        Eigen::Vector3d(rng.uniform(-1.5, 1.5), rng.uniform(-1, 1), rng.uniform(2, 4)).cast<S>();
    points.push_back(p + (0.02 * Eigen::Vector3d(rng.normal(), rng.normal(), rng.normal())).cast<S>());
    for (int i = 0; i < 5; ++i) {
      const Eigen::Matrix<S, 3, 1> p_c = truth[static_cast<std::size_t>(i)] * p;
      const auto x = camera.project(p_c);
      if (!x) continue;
      BundleObservation<S> o;
      o.pose = i;
      o.point = j;
      o.x = *x;
      o.depth = p_c.z();
      o.inv_sigma_z2 = S(1e4);
      observations.push_back(o);
    }
  }
  BundleOptions<S> options;
  options.max_iterations = 30;
  options.tolerance = S(1e-12);
  const auto result = bundle_adjust(camera, BundleProblem<S>{poses, fixed, points, observations}, options);
  CHECK(result.ok());
  CHECK(result.final_cost < S(1e-3) * result.initial_cost);
  for (std::size_t i = 0; i < poses.size(); ++i)
    CHECK((poses[i] * truth[i].inverse()).log().norm() < (std::same_as<S, float> ? S(1e-3) : S(1e-7)));
}
