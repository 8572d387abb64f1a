// SPDX-License-Identifier: BSD-3-Clause
// Rival of bundle_adjust: Ceres with the same residuals and loss, Jacobians in closed form, its Schur
// complement dense or sparse.
#pragma once

#include <cstddef>
#include <vector>

#include "baselines/pose_ceres.hpp"
#include "dynslam/optim/bundle_adjustment.hpp"

namespace dynslam::baselines {

class BundleCost : public ceres::SizedCostFunction<3, 7, 3> {
 public:
  /// @param o  its point is the parameter
  BundleCost(const Pinhole<double>& camera, const PoseObservation<double>& o) : camera_(camera), o_(o) {}
  bool Evaluate(const double* const* parameters, double* residuals, double** jacobians) const override {
    const SE3d T = from_ceres(parameters[0]);
    const Eigen::Vector3d point(parameters[1]), p = T * point;
    Eigen::Vector3d r;
    Eigen::Matrix3d by_point;
    pose_residual(camera_, o_, p, r, jacobians != nullptr ? &by_point : nullptr);
    Eigen::Map<Eigen::Vector3d>(residuals, 3) = r;
    if (jacobians == nullptr) return true;
    if (jacobians[0] != nullptr) put_pose_jacobian(by_point, p, jacobians[0]);
    if (jacobians[1] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> by_world(jacobians[1]);
      by_world = by_point * T.rotation_matrix();
    }
    return true;
  }

 private:
  Pinhole<double> camera_;
  PoseObservation<double> o_;
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
  auto* manifold = new LeftPoses;
  ceres::Solver::Options options;
  options.linear_solver_ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (const auto& o : problem.observations) {
    const auto i = static_cast<std::size_t>(o.pose), j = static_cast<std::size_t>(o.point);
    solved.AddResidualBlock(new BundleCost(camera, pose_observation(o, problem.points[j])), &loss,
                            poses[i].data(), points[j].data());
    solved.SetManifold(poses[i].data(), manifold);
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
