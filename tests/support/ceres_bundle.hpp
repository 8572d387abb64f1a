// SPDX-License-Identifier: BSD-3-Clause
// Ceres' answer to the bundle adjustment problems of dynslam.
#pragma once

#include "ceres_oracle.hpp"  // first: see there

#ifdef DYNSLAM_HAVE_CERES
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/optim/bundle_adjustment.hpp"

namespace dynslam::test {

struct BundleResidual {
  Pinhole<double> camera;
  BundleObservation<double> o;
  template <class T>
  bool operator()(const T* pose, const T* point, T* r) const {
    T p[3];
    ceres::AngleAxisRotatePoint(pose, point, p);
    for (int i = 0; i < 3; ++i) p[i] += pose[3 + i];
    const double px = std::sqrt(o.inv_sigma_px2);
    r[0] = (camera.fx() * p[0] / p[2] + camera.cx() - o.x.x()) * px;
    r[1] = (camera.fy() * p[1] / p[2] + camera.cy() - o.x.y()) * px;
    r[2] = measures_depth(o.depth, o.inv_sigma_z2) ? (p[2] - o.depth) * std::sqrt(o.inv_sigma_z2) : T(0);
    return true;
  }
};

/// Sum of rho of the t-distribution after Ceres has minimised it; the problem itself stays as it is.
inline double ceres_bundle_cost(const Pinhole<double>& camera, const BundleProblem<double>& problem,
                                double nu) {
  std::vector<std::array<double, 6>> poses(problem.poses.size());
  std::vector<Eigen::Vector3d> points(problem.points.begin(), problem.points.end());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Eigen::Vector3d angle = problem.poses[i].so3().log();
    for (std::size_t k = 0; k < 3; ++k) {
      poses[i][k] = angle(static_cast<Eigen::Index>(k));
      poses[i][k + 3] = problem.poses[i].translation()(static_cast<Eigen::Index>(k));
    }
  }
  ceres::Problem solved;
  for (const auto& o : problem.observations) {
    auto* loss = new TLoss;
    loss->nu = nu;
    loss->numerator = nu + 1;
    solved.AddResidualBlock(
        new ceres::AutoDiffCostFunction<BundleResidual, 3, 6, 3>(new BundleResidual{camera, o}), loss,
        poses[static_cast<std::size_t>(o.pose)].data(), points[static_cast<std::size_t>(o.point)].data());
  }
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (problem.fixed[i] != 0 && solved.HasParameterBlock(poses[i].data()))
      solved.SetParameterBlockConstant(poses[i].data());
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_SCHUR;
  options.max_num_iterations = 500;
  options.function_tolerance = 1e-14;
  options.parameter_tolerance = 1e-14;
  options.gradient_tolerance = 1e-14;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &solved, &summary);
  return 2 * summary.final_cost;
}

}  // namespace dynslam::test
#endif
