// SPDX-License-Identifier: BSD-3-Clause
// Pose graphs with a loop.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <vector>

#include "dynslam/optim/pose_graph.hpp"
#include "random.hpp"

namespace dynslam::test {

using Vector6 = SE3d::Vector6;
using Matrix6 = SE3d::Matrix6;

inline Vector6 small(Rng& rng, double metres, double radians) {
  Vector6 v;
  for (int i = 0; i < 6; ++i) v(i) = rng.normal() * (i < 3 ? metres : radians);
  return v;
}

/// A camera that goes around a circle and comes back; odometry with noise and drift, one loop edge.
struct Ring {
  std::vector<SE3d> truth, poses;
  std::vector<std::uint8_t> fixed;
  std::vector<PoseGraphEdge<double>> edges;

  Ring(Rng& rng, int n, bool wrong_loop = false) : fixed(static_cast<std::size_t>(n), 0) {
    fixed[0] = 1;
    for (int k = 0; k < n; ++k) {
      const double a = 2 * std::numbers::pi * k / n;
      const SE3d T_w_c(SO3d::exp(Eigen::Vector3d(0, -a, 0)),
                       Eigen::Vector3d(3 * std::cos(a), 0.2 * std::sin(3 * a), 3 * std::sin(a)));
      truth.push_back(T_w_c.inverse());
    }
    Vector6 drift;
    drift << 0.004, 0.001, -0.003, 0.0005, 0.003, -0.0005;
    poses.push_back(truth[0]);
    const auto add = [&](int i, int j, const Vector6& error) {
      PoseGraphEdge<double> e;
      e.i = i;
      e.j = j;
      e.T_j_i = SE3d::exp(error) * truth[static_cast<std::size_t>(j)] *
                truth[static_cast<std::size_t>(i)].inverse();
      Matrix6 A;
      for (int c = 0; c < 36; ++c) A(c / 6, c % 6) = rng.normal();
      e.information = 1e4 * (Matrix6::Identity() + 0.02 * A * A.transpose());
      edges.push_back(e);
    };
    for (int k = 1; k < n; ++k) {
      add(k - 1, k, drift + small(rng, 0.003, 0.001));
      poses.push_back(edges.back().T_j_i * poses.back());
      if (k > 1) add(k - 2, k, 2 * drift + small(rng, 0.004, 0.002));
    }
    add(n - 1, 0, small(rng, 0.003, 0.001));
    if (wrong_loop) add(n / 2, 0, small(rng, 1.0, 1.0));
  }
};

inline double end_error(const Ring& ring) {
  return (ring.poses.back() * ring.truth.back().inverse()).log().norm();
}

}  // namespace dynslam::test
