// SPDX-License-Identifier: BSD-3-Clause
// Rival of optimize_pose_graph: Ceres with the same errors and Jacobians.
#pragma once

#include <Eigen/Cholesky>
#include <algorithm>
#include <cstddef>
#include <vector>

#include "baselines/se3_ceres.hpp"
#include "dynslam/optim/pose_graph.hpp"

namespace dynslam::baselines {

class PoseGraphCost : public ceres::SizedCostFunction<6, 7, 7> {
 public:
  explicit PoseGraphCost(const PoseGraphEdge<double>& edge)
      : T_j_i_(edge.T_j_i), root_(edge.information.llt().matrixU()) {}
  bool Evaluate(const double* const* poses, double* residuals, double** jacobians) const override {
    using Matrix6 = Eigen::Matrix<double, 6, 6>;
    Matrix6 J[2];
    const bool derive = jacobians != nullptr;
    Eigen::Map<Eigen::Matrix<double, 6, 1>> out(residuals);
    out = root_ * pose_graph_residual<double>(from_ceres(poses[0]), from_ceres(poses[1]), T_j_i_,
                                              derive ? &J[0] : nullptr, derive ? &J[1] : nullptr);
    for (int k = 0; derive && k < 2; ++k) {
      if (jacobians[k] == nullptr) continue;
      Eigen::Map<Eigen::Matrix<double, 6, 7, Eigen::RowMajor>> to(jacobians[k]);
      to.leftCols<6>().noalias() = root_ * J[k];
      to.col(6).setZero();
    }
    return true;
  }

 private:
  SE3d T_j_i_;
  Eigen::Matrix<double, 6, 6> root_;  // information = root^T root
};

/// The poses after Ceres has minimised; the graph stays as it is.
[[nodiscard]] inline std::vector<SE3d> ceres_pose_graph(const PoseGraph<double>& graph, double tolerance) {
  std::vector<CeresPose> poses;
  for (const SE3d& T : graph.poses) poses.push_back(to_ceres(T));
  ceres::Problem problem;
  auto* manifold = new LeftPoses;
  for (const auto& e : graph.edges) {
    double* const i = poses[static_cast<std::size_t>(e.i)].data();
    double* const j = poses[static_cast<std::size_t>(e.j)].data();
    problem.AddResidualBlock(new PoseGraphCost(e), nullptr, i, j);
    problem.SetManifold(i, manifold);
    problem.SetManifold(j, manifold);
  }
  for (std::size_t k = 0; k < poses.size(); ++k) {
    if (graph.fixed[k] != 0) problem.SetParameterBlockConstant(poses[k].data());
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.num_threads = 1;
  options.max_num_iterations = 100;
  options.function_tolerance = tolerance;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  std::vector<SE3d> result;
  for (const CeresPose& pose : poses) result.push_back(from_ceres(pose.data()));
  return result;
}

}  // namespace dynslam::baselines
