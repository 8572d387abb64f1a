// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "dynslam/optim/bundle_adjustment.hpp"
#include "support/scene.hpp"

namespace dynslam::bench {

/// A window as a tracker leaves it: poses off by a centimetre, points by three, pixels and depths noisy, one
/// sight in twenty wrong, one in three missing, one depth in five. The first two poses are fixed.
template <class S>
struct Window {
  std::vector<SE3<S>> poses;
  std::vector<std::uint8_t> fixed;
  std::vector<Eigen::Matrix<S, 3, 1>> points;
  std::vector<BundleObservation<S>> observations;

  [[nodiscard]] BundleProblem<S> problem() { return {poses, fixed, points, observations}; }
};

[[nodiscard]] inline Eigen::Vector3d normal_vector(Random& random, double size) {
  const double x = random.normal(), y = random.normal(), z = random.normal();
  return size * Eigen::Vector3d(x, y, z);
}
[[nodiscard]] inline Eigen::Vector2d normal_pixel(Random& random, double size) {
  const double x = random.normal(), y = random.normal();
  return size * Eigen::Vector2d(x, y);
}

/// Numbers are drawn in double, so that float has the same window.
template <class S>
[[nodiscard]] Window<S> make_window(int keyframes, int points) {
  Random random(11);
  Window<S> w;
  std::vector<SE3d> truth;
  for (int i = 0; i < keyframes; ++i) {
    Eigen::Matrix<double, 6, 1> xi, error;
    xi.head<3>() = normal_vector(random, 0.2);
    xi.tail<3>() = normal_vector(random, 0.1);
    for (int k = 0; k < 6; ++k) error(k) = 0.01 * random.normal();
    truth.push_back(SE3d::exp(xi));
    w.fixed.push_back(i < 2 ? 1 : 0);
    w.poses.push_back((i < 2 ? truth.back() : SE3d::exp(error) * truth.back()).cast<S>());
  }
  const Pinhole<double> pinhole = camera<double>();
  for (int j = 0; j < points; ++j) {
    const Eigen::Vector3d p(random.uniform(-2, 2), random.uniform(-1.5, 1.5), random.uniform(1.5, 5));
    const Eigen::Vector3d moved = p + normal_vector(random, 0.03);
    w.points.push_back(moved.template cast<S>());
    for (int i = 0; i < keyframes; ++i) {
      const Eigen::Vector3d p_c = truth[static_cast<std::size_t>(i)] * p;
      auto x = pinhole.project(p_c);
      if (!x || x->x() < 0 || x->y() < 0 || x->x() > 639 || x->y() > 479 || random.uniform(0, 1) < 0.3)
        continue;
      const double sigma_z = 0.001 + 0.0019 * p_c.z() * p_c.z();
      *x += normal_pixel(random, 0.5);
      if (random.uniform(0, 1) < 0.05) *x += normal_pixel(random, 20);
      BundleObservation<S> o;
      o.pose = i;
      o.point = j;
      o.x = x->template cast<S>();
      o.depth = random.uniform(0, 1) < 0.2 ? S(0) : S(p_c.z() + sigma_z * random.normal());
      o.inv_sigma_px2 = S(4);
      o.inv_sigma_z2 = S(1 / (sigma_z * sigma_z));
      w.observations.push_back(o);
    }
  }
  return w;
}

}  // namespace dynslam::bench
