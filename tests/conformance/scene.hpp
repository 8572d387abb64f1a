// SPDX-License-Identifier: BSD-3-Clause
// An exact scene for estimators: whatever camera and scalar, it has the same answer.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "cameras.hpp"
#include "dynslam/geometry/se3.hpp"
#include "random.hpp"
#include "record.hpp"

namespace dynslam::test {

[[nodiscard]] inline SE3<double> pose_of(double a) {
  Eigen::Matrix<double, 6, 1> xi;
  xi << 0.2 * a, -0.1 * a, 0.1 * a, 0.03 * a, -0.05 * a, 0.04 * a;
  return SE3<double>::exp(xi);
}

/// Points that every camera sees from every pose_of(0 ... 1).
[[nodiscard]] inline const std::vector<Eigen::Vector3d>& points() {
  static const std::vector<Eigen::Vector3d> all = [] {
    std::vector<Eigen::Vector3d> p;
    Rng rng("conformance points");
    for (int i = 0; i < 80; ++i)
      p.emplace_back(rng.uniform(-0.8, 0.8), rng.uniform(-0.6, 0.6), rng.uniform(2, 4));
    return p;
  }();
  return all;
}

template <std::floating_point S>
void put_pose(Record<double>& out, const char* name, const SE3<S>& T) {
  out.put(name, T.template cast<double>().log());
}

}  // namespace dynslam::test
