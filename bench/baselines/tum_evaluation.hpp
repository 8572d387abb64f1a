// SPDX-License-Identifier: BSD-3-Clause
// Rival of the trajectory evaluation: TUM's associate.py and evaluate_ate.py, line by line in C++.
#pragma once

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <span>
#include <tuple>
#include <vector>

#include "dynslam/eval/trajectory.hpp"

namespace dynslam::baselines {

/// All pairs of stamps within the limit, nearest first, each stamp once.
[[nodiscard]] inline std::map<std::size_t, std::size_t> tum_associate(std::span<const double> a,
                                                                      std::span<const double> b,
                                                                      double max_difference) {
  std::vector<std::tuple<double, std::size_t, std::size_t>> candidates;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t j = 0; j < b.size(); ++j) {
      if (std::abs(a[i] - b[j]) < max_difference) candidates.emplace_back(std::abs(a[i] - b[j]), i, j);
    }
  }
  std::sort(candidates.begin(), candidates.end());
  std::vector<bool> used_a(a.size()), used_b(b.size());
  std::map<std::size_t, std::size_t> pairs;
  for (const auto& [difference, i, j] : candidates) {
    if (used_a[i] || used_b[j]) continue;
    used_a[i] = used_b[j] = true;
    pairs[i] = j;
  }
  return pairs;
}

/// Root of the mean squared error after alignment (Umeyama's, without scale), in double, as numpy has it.
[[nodiscard]] inline double tum_ate(std::span<const StampedPose<double>> estimate,
                                    std::span<const StampedPose<double>> truth, double max_difference) {
  std::vector<double> t_truth, t_estimate;
  for (const auto& pose : truth) t_truth.push_back(pose.t);
  for (const auto& pose : estimate) t_estimate.push_back(pose.t);
  const auto pairs = tum_associate(t_truth, t_estimate, max_difference);
  Eigen::Matrix<double, 3, Eigen::Dynamic> from(3, static_cast<Eigen::Index>(pairs.size())), to = from;
  Eigen::Index k = 0;
  for (const auto& [i, j] : pairs) {
    to.col(k) = truth[i].T_w_c.translation();
    from.col(k++) = estimate[j].T_w_c.translation();
  }
  const Eigen::Matrix<double, 4, 4> T = Eigen::umeyama(from, to, false);
  const Eigen::Matrix<double, 3, Eigen::Dynamic> error =
      ((T.topLeftCorner<3, 3>() * from).colwise() + T.topRightCorner<3, 1>()) - to;
  return std::sqrt(error.squaredNorm() / static_cast<double>(pairs.size()));
}

}  // namespace dynslam::baselines
