// SPDX-License-Identifier: BSD-3-Clause
// Rival of bundle_adjust: Ceres with the same residuals and loss, its Schur complement dense or sparse.
#pragma once

#include <cstddef>
#include <vector>

#include "baselines/pose_ceres.hpp"
#include "dynslam/optim/bundle_adjustment.hpp"

namespace dynslam::baselines {

struct BundleCost {
  Pinhole<double> camera;
  PoseObservation<double> o;  // its point is the parameter
  template <class T>
  bool operator()(const T* pose, const T* point, T* r) const {
    pose_residual(camera, o, pose, point, r);
    return true;
  }
};

/// Poses and points stay as they are. @param tolerance  relative decrease of the cost that ends it
/// @return the final cost as bundle_adjust states it: the sum of rho
[[nodiscard]] inline double ceres_bundle(const Pinhole<double>& camera, const BundleProblem<double>& problem,
                                         ceres::LinearSolverType solver, double tolerance) {
  std::vector<CeresPose> poses;
  for (const SE3d& T : problem.poses) poses.push_back(to_ceres(T));
  std::vector<Eigen::Vector3d> points(problem.points.begin(), problem.points.end());
  ceres::Problem::Options shared;
  shared.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  TLoss loss;
  ceres::Problem solved(shared);
  ceres::Solver::Options options;
  options.linear_solver_ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (const auto& o : problem.observations) {
    const auto i = static_cast<std::size_t>(o.pose), j = static_cast<std::size_t>(o.point);
    solved.AddResidualBlock(new ceres::AutoDiffCostFunction<BundleCost, 3, 6, 3>(
                                new BundleCost{camera, pose_observation(o, problem.points[j])}),
                            &loss, poses[i].data(), points[j].data());
    options.linear_solver_ordering->AddElementToGroup(points[j].data(), 0);
    options.linear_solver_ordering->AddElementToGroup(poses[i].data(), 1);
  }
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (problem.fixed[i] != 0 && solved.HasParameterBlock(poses[i].data()))
      solved.SetParameterBlockConstant(poses[i].data());
  }
  options.linear_solver_type = solver;
  options.num_threads = 1;
  options.max_num_iterations = 100;
  options.function_tolerance = tolerance;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &solved, &summary);
  return 2 * summary.final_cost;
}

}  // namespace dynslam::baselines
