// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "dynslam/geometry/epipolar_distance.hpp"
#include "dynslam/geometry/homography.hpp"
#include "dynslam/geometry/se3.hpp"
#include "support/rng.hpp"
#include "support/scene.hpp"

namespace dynslam::bench {

/// Matches of two views, with noise, some of them wrong.
template <class S>
struct TwoViewScene {
  std::vector<Eigen::Matrix<S, 2, 1>> x, x_m;     ///< [px]
  std::vector<Eigen::Vector2d> true_x, true_x_m;  ///< without noise and mistakes
  std::vector<std::uint8_t> on_plane;             ///< 1: of the plane, where there is one
  std::vector<std::uint8_t> right;                ///< 1: not one of the wrong matches
};

enum class SceneKind { room, plane, small_baseline, plane_and_few };

/// A scene of 300 matches: kinds take turns, as do shares of wrong matches of 10, 20, 30, 40 and 50 %.
/// @param index  of the scene; the same one is the same in every run
template <class S>
[[nodiscard]] TwoViewScene<S> two_view_scene(int index, int matches = 300) {
  Random random(1000 + static_cast<std::uint64_t>(index));
  const auto noise = [&] {  // close to normal, of 0.4 px
    return 0.4 * (random.uniform(-1, 1) + random.uniform(-1, 1) + random.uniform(-1, 1));
  };
  const auto kind = static_cast<SceneKind>(index % 4);
  const double outliers = 0.1 * (1 + (index / 4) % 5);
  const double baseline = kind == SceneKind::small_baseline ? 0.02 : 0.25, a = random.uniform(-3, 3);
  Eigen::Matrix<double, 6, 1> xi;
  xi << baseline * std::cos(a), baseline * std::sin(a), 0.2 * baseline, random.uniform(-0.03, 0.03),
      random.uniform(-0.06, 0.06), random.uniform(-0.05, 0.05);
  const SE3<double> motion = SE3<double>::exp(xi);
  const Pinhole<double> camera = bench::camera<double>();
  const Eigen::Vector3d normal = Eigen::Vector3d(0.2, -0.1, 1).normalized();
  TwoViewScene<S> scene;
  while (static_cast<int>(scene.x.size()) < matches) {
    Eigen::Vector2d x(random.uniform(20, 620), random.uniform(20, 460));
    const Eigen::Vector3d ray = camera.ray(x);
    const bool on_plane =
        kind == SceneKind::plane || (kind == SceneKind::plane_and_few && random.uniform(0, 1) < 0.8);
    const double z = on_plane ? 2.0 / normal.dot(ray) : random.uniform(1, 5);
    const auto seen = camera.project(motion * Eigen::Vector3d(ray * z));
    if (!seen) continue;
    const bool wrong = random.uniform(0, 1) < outliers;
    Eigen::Vector2d x_m = *seen + Eigen::Vector2d(noise(), noise());
    if (wrong) x_m = Eigen::Vector2d(random.uniform(0, 640), random.uniform(0, 480));
    scene.x.push_back(x.cast<S>());
    scene.x_m.push_back(x_m.cast<S>());
    scene.true_x.push_back(x);
    scene.true_x_m.push_back(*seen);
    scene.on_plane.push_back(on_plane ? 1 : 0);
    scene.right.push_back(wrong ? 0 : 1);
  }
  return scene;
}

/// Squared error of a model [px^2], summed over the right matches without noise, and their number: Sampson's
/// distance of F, or the transfer error of H on the plane.
template <class S>
[[nodiscard]] std::pair<double, int> squared_error(const TwoViewScene<S>& scene, const Eigen::Matrix3d& M,
                                                   bool homography) {
  double sum = 0;
  int n = 0;
  for (std::size_t i = 0; i < scene.right.size(); ++i) {
    if (scene.right[i] == 0 || (homography && scene.on_plane[i] == 0)) continue;
    sum += homography ? transfer_distance_squared<double>(M, scene.true_x[i], scene.true_x_m[i])
                      : sampson_distance_squared<double>(M, scene.true_x[i], scene.true_x_m[i]);
    ++n;
  }
  return {sum, n};
}

}  // namespace dynslam::bench
