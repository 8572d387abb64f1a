// SPDX-License-Identifier: BSD-3-Clause
// An estimator needs the derivative of the projection. EXPECT: DifferentiableCamera
#include <optional>
#include <span>

#include "dynslam/optim/pose.hpp"

struct Camera {
  using ScalarType = double;
  std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& p) const { return p.hnormalized(); }
  std::optional<Eigen::Vector3d> unproject(const Eigen::Vector2d& x, double z) const {
    return Eigen::Vector3d(x.x() * z, x.y() * z, z);
  }
#ifdef RIGHT
  std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& p, Eigen::Matrix<double, 2, 3>* J) const {
    if (J != nullptr) *J << 1 / p.z(), 0, -p.x() / (p.z() * p.z()), 0, 1 / p.z(), -p.y() / (p.z() * p.z());
    return p.hnormalized();
  }
#endif
};

dynslam::PoseResult<double> pose(std::span<const dynslam::PoseObservation<double>> observations) {
  dynslam::PoseWorkspace<double> workspace;
  return dynslam::optimize_pose<double>(Camera(), observations, dynslam::SE3<double>(),
                                        dynslam::PoseOptions<double>(),
                                        dynslam::TDistribution<double>::with_dimension(5.0, 1), workspace);
}
