// SPDX-License-Identifier: BSD-3-Clause
// Windows for bundle adjustment.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "dynslam/optim/bundle_adjustment.hpp"
#include "random.hpp"
#include "tum_cameras.hpp"

namespace dynslam::test {

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

inline Window make_window(Rng& rng, int poses, int points, double wrong, bool noise = true) {
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
      const auto x = kFreiburg3.project(p_c);
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

}  // namespace dynslam::test
