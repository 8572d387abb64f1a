// SPDX-License-Identifier: BSD-3-Clause
// Rival of optimize_pose_graph: Ceres as its pose-graph example does it, the rotation a quaternion with its
// manifold. Its error (translation and twice the vector part of the relative rotation) is that of dynslam to
// first order.
#pragma once

#include <ceres/ceres.h>

#include <cstddef>
#include <vector>

#include "dynslam/optim/pose_graph.hpp"

namespace dynslam::baselines {

struct PoseGraphCost {
  SE3d T_j_i;
  Eigen::Matrix<double, 6, 6> root;  // information = root^T root
  template <class T>
  bool operator()(const T* qi, const T* ti, const T* qj, const T* tj, T* r) const {
    using Vector = Eigen::Matrix<T, 3, 1>;
    const Eigen::Map<const Eigen::Quaternion<T>> q_i(qi), q_j(qj);
    const Eigen::Map<const Vector> t_i(ti), t_j(tj);
    // T_j_w T_w_i T_i_j, the identity where the poses agree with the measurement.
    const Eigen::Quaternion<T> q_ji = q_j * q_i.conjugate();
    const Vector t_ji = t_j - q_ji * t_i;
    const Eigen::Quaternion<T> q =
        q_ji * Eigen::Quaterniond(T_j_i.rotation_matrix()).conjugate().template cast<T>();
    Eigen::Map<Eigen::Matrix<T, 6, 1>> out(r);
    out.template head<3>() = t_ji - q * T_j_i.translation().template cast<T>();
    out.template tail<3>() = T(2) * q.vec();
    out = root.template cast<T>() * out.eval();
    return true;
  }
};

/// The poses after Ceres has minimised; the graph stays as it is.
[[nodiscard]] inline std::vector<SE3d> ceres_pose_graph(const PoseGraph<double>& graph, double tolerance) {
  std::vector<Eigen::Quaterniond> q;
  std::vector<Eigen::Vector3d> t;
  for (const SE3d& T : graph.poses) {
    q.emplace_back(T.rotation_matrix());
    t.push_back(T.translation());
  }
  ceres::Problem problem;
  auto* manifold = new ceres::EigenQuaternionManifold;
  for (const auto& e : graph.edges) {
    const auto i = static_cast<std::size_t>(e.i), j = static_cast<std::size_t>(e.j);
    const Eigen::Matrix<double, 6, 6> root = e.information.llt().matrixU();
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<PoseGraphCost, 6, 4, 3, 4, 3>(new PoseGraphCost{e.T_j_i, root}),
        nullptr, q[i].coeffs().data(), t[i].data(), q[j].coeffs().data(), t[j].data());
    problem.SetManifold(q[i].coeffs().data(), manifold);
    problem.SetManifold(q[j].coeffs().data(), manifold);
  }
  for (std::size_t k = 0; k < q.size(); ++k) {
    if (graph.fixed[k] == 0) continue;
    problem.SetParameterBlockConstant(q[k].coeffs().data());
    problem.SetParameterBlockConstant(t[k].data());
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.num_threads = 1;
  options.max_num_iterations = 100;
  options.function_tolerance = tolerance;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  std::vector<SE3d> poses;
  for (std::size_t k = 0; k < q.size(); ++k) poses.emplace_back(q[k], t[k]);
  return poses;
}

}  // namespace dynslam::baselines
