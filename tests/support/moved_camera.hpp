// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/geometry/se3.hpp"

namespace dynslam::test {

/// A camera's motion: a step, and a turn of roughly `angle` mostly about the y axis.
inline SE3d moved(double tx, double ty, double tz, double angle) {
  Eigen::Matrix<double, 6, 1> xi;
  xi << tx, ty, tz, 0.3 * angle, angle, -0.2 * angle;
  return SE3d::exp(xi);
}

}  // namespace dynslam::test
