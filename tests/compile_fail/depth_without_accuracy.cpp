// SPDX-License-Identifier: BSD-3-Clause
// A depth without its accuracy would not count. EXPECT: PoseObservation
#include "dynslam/optim/pose_residual.hpp"

dynslam::PoseObservation<double> observation(const Eigen::Vector3d& p_w, const Eigen::Vector2d& x) {
#ifdef RIGHT
  return {p_w, x, 1.5, 1.0, 1e4};
#else
  return {p_w, x, 1.5};
#endif
}
