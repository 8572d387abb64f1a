// SPDX-License-Identifier: BSD-3-Clause
// Ceres as an independent oracle of the pose graph: same residuals, same loss, same minimum.
#include "ceres_oracle.hpp"  // first: see there

#ifdef DYNSLAM_HAVE_CERES
#include <vector>

#include "dynslam/robust/kernels.hpp"
#include "pose_ring.hpp"
#include "random.hpp"

using namespace dynslam;
using test::Matrix6;
using test::Ring;
using test::Vector6;

namespace {

struct EdgeResidual {
  PoseGraphEdge<double> e;
  Matrix6 root;  // information = root^T root
  template <class T>
  bool operator()(const T* ti, const T* tj, T* r) const {
    Eigen::Matrix<T, 6, 1> di, dj;
    for (int k = 0; k < 6; ++k) {
      di(k) = ti[k];
      dj(k) = tj[k];
    }
    // Parameters are tangents at the given poses: the manifold is not Ceres' business here.
    const SE3<T> Ti = SE3<T>::exp(di), Tj = SE3<T>::exp(dj);
    const Eigen::Matrix<T, 6, 1> error = (Tj * Ti.inverse() * e.T_j_i.inverse().cast<T>()).log();
    Eigen::Map<Eigen::Matrix<T, 6, 1>> out(r);
    out = root.cast<T>() * error;
    return true;
  }
};

}  // namespace

TEST_CASE("the minimum of a pose graph is Ceres'") {
  test::Rng rng("ring");
  Ring ring(rng, 60);
  std::vector<Vector6> parameters;
  for (const SE3d& T : ring.poses) parameters.push_back(T.log());
  ceres::Problem problem;
  for (const auto& e : ring.edges) {
    const Matrix6 root = e.information.llt().matrixU();
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<EdgeResidual, 6, 6, 6>(new EdgeResidual{e, root}),
        new ceres::HuberLoss(3.0), parameters[static_cast<std::size_t>(e.i)].data(),
        parameters[static_cast<std::size_t>(e.j)].data());
  }
  problem.SetParameterBlockConstant(parameters[0].data());
  const PoseGraph<double> graph{ring.poses, ring.fixed, ring.edges};
  PoseGraphOptions<double> options;
  options.tolerance = 1e-12;
  const auto result = optimize_pose_graph<double>(graph, options, Huber<double>{3.0});
  CHECK(result.status == PoseGraphStatus::converged);
  ceres::Solver::Options solver;
  solver.max_num_iterations = 200;
  solver.function_tolerance = solver.gradient_tolerance = solver.parameter_tolerance = 1e-14;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  CHECK(result.final_cost == doctest::Approx(2 * summary.final_cost).epsilon(1e-6));
  for (std::size_t k = 0; k < ring.poses.size(); ++k)
    CHECK((ring.poses[k] * SE3d::exp(parameters[k]).inverse()).log().norm() < 1e-5);
}
#else
DYNSLAM_SKIP_WITHOUT_CERES("the minimum of a pose graph is Ceres'")
#endif
