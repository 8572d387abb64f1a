// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "dynslam/geometry/se3.hpp"
#include "moved_camera.hpp"
#include "random.hpp"
#include "tum_cameras.hpp"

namespace dynslam::test {

/// Matches of two views of freiburg3's camera, with noise, some of them wrong, and what they are without.
struct MatchedScene {
  enum class Kind { room, mostly_plane, small_baseline };
  SE3d T_cur_ref;
  std::vector<Eigen::Vector2d> x, x_m, true_x_m;
  std::vector<bool> right, plane;

  MatchedScene(Rng& rng, Kind kind, int matches, double wrong, double noise_px) {
    const double baseline = kind == Kind::small_baseline ? 0.03 : 0.25, a = rng.uniform(-3, 3);
    T_cur_ref =
        moved(baseline * std::cos(a), baseline * std::sin(a), 0.1 * baseline, rng.uniform(-0.06, 0.06));
    const Eigen::Vector3d normal = Eigen::Vector3d(0.2, -0.1, 1).normalized();
    while (static_cast<int>(x.size()) < matches) {
      const Eigen::Vector2d u(rng.uniform(20, 620), rng.uniform(20, 460));
      const Eigen::Vector3d ray = kFreiburg3.ray(u);
      const bool on_plane = kind == Kind::mostly_plane && rng.chance(0.8), bad = rng.chance(wrong);
      const auto seen = kFreiburg3.project(
          T_cur_ref * Eigen::Vector3d(ray * (on_plane ? 2 / normal.dot(ray) : rng.uniform(1, 5))));
      if (!seen || !(seen->minCoeff() > 0 && seen->x() < 640 && seen->y() < 480)) continue;
      x.push_back(u);
      true_x_m.push_back(*seen);
      x_m.push_back(*seen + noise_px * Eigen::Vector2d(rng.normal(), rng.normal()));
      if (bad) x_m.back() = {rng.uniform(0, 640), rng.uniform(0, 480)};
      right.push_back(!bad);
      plane.push_back(on_plane);
    }
  }

  /// RMS of Sampson's distance of the right matches without noise [px].
  [[nodiscard]] double error_of_fundamental(const Eigen::Matrix3d& F) const {
    double sum = 0, n = 0;
    for (std::size_t i = 0; i < x.size(); ++i) {
      if (!right[i]) continue;
      const Eigen::Vector3d p(x[i].x(), x[i].y(), 1), q(true_x_m[i].x(), true_x_m[i].y(), 1),
          l = F * p, m = F.transpose() * q;
      sum += q.dot(l) * q.dot(l) / (l.head<2>().squaredNorm() + m.head<2>().squaredNorm());
      ++n;
    }
    return std::sqrt(sum / n);
  }
  /// RMS distance of H x to the right matches on the plane without noise [px].
  [[nodiscard]] double error_of_homography(const Eigen::Matrix3d& H) const {
    double sum = 0, n = 0;
    for (std::size_t i = 0; i < x.size(); ++i) {
      if (!right[i] || !plane[i]) continue;
      const Eigen::Vector3d there = H * Eigen::Vector3d(x[i].x(), x[i].y(), 1);
      sum += (there.head<2>() / there.z() - true_x_m[i]).squaredNorm();
      ++n;
    }
    return std::sqrt(sum / n);
  }
  [[nodiscard]] double right_matches() const {
    return static_cast<double>(std::count(right.begin(), right.end(), true));
  }
};

/// Of numbers, which are sorted: the one that a share is below.
[[nodiscard]] inline double quantile(std::vector<double> numbers, double share) {
  std::sort(numbers.begin(), numbers.end());
  return numbers[std::min(numbers.size() - 1,
                          static_cast<std::size_t>(share * static_cast<double>(numbers.size())))];
}

}  // namespace dynslam::test
