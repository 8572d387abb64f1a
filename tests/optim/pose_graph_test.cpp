// SPDX-License-Identifier: BSD-3-Clause
#include "ceres_oracle.hpp"

#include <cmath>
#include <numbers>
#include <vector>

#include "dynslam/optim/pose_graph.hpp"
#include "dynslam/robust/kernels.hpp"
#include "jacobian.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

using Vector6 = SE3d::Vector6;
using Matrix6 = SE3d::Matrix6;

Vector6 small(test::Rng& rng, double metres, double radians) {
  Vector6 v;
  for (int i = 0; i < 6; ++i) v(i) = rng.normal() * (i < 3 ? metres : radians);
  return v;
}

/// A camera that goes around a circle and comes back; odometry with noise and drift, one loop edge.
struct Ring {
  std::vector<SE3d> truth, poses;
  std::vector<std::uint8_t> fixed;
  std::vector<PoseGraphEdge<double>> edges;

  Ring(test::Rng& rng, int n, bool wrong_loop = false) : fixed(static_cast<std::size_t>(n), 0) {
    fixed[0] = 1;
    for (int k = 0; k < n; ++k) {
      const double a = 2 * std::numbers::pi * k / n;
      const SE3d T_w_c(SO3d::exp(Eigen::Vector3d(0, -a, 0)),
                       Eigen::Vector3d(3 * std::cos(a), 0.2 * std::sin(3 * a), 3 * std::sin(a)));
      truth.push_back(T_w_c.inverse());
    }
    Vector6 drift;
    drift << 0.004, 0.001, -0.003, 0.0005, 0.003, -0.0005;
    poses.push_back(truth[0]);
    const auto add = [&](int i, int j, const Vector6& error) {
      PoseGraphEdge<double> e;
      e.i = i;
      e.j = j;
      e.T_j_i = SE3d::exp(error) * truth[static_cast<std::size_t>(j)] *
                truth[static_cast<std::size_t>(i)].inverse();
      Matrix6 A;
      for (int c = 0; c < 36; ++c) A(c / 6, c % 6) = rng.normal();
      e.information = 1e4 * (Matrix6::Identity() + 0.02 * A * A.transpose());
      edges.push_back(e);
    };
    for (int k = 1; k < n; ++k) {
      add(k - 1, k, drift + small(rng, 0.003, 0.001));
      poses.push_back(edges.back().T_j_i * poses.back());
      if (k > 1) add(k - 2, k, 2 * drift + small(rng, 0.004, 0.002));
    }
    add(n - 1, 0, small(rng, 0.003, 0.001));
    if (wrong_loop) add(n / 2, 0, small(rng, 1.0, 1.0));
  }
};

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

double end_error(const Ring& ring) {
  return (ring.poses.back() * ring.truth.back().inverse()).log().norm();
}

}  // namespace

TEST_CASE("the derivatives of an edge are those of central differences, far from zero too") {
  test::Rng rng("pose graph jacobian");
  for (int trial = 0; trial < 50; ++trial) {
    const SE3d Ti = SE3d::exp(small(rng, 1, 0.5)), Tj = SE3d::exp(small(rng, 1, 0.5)),
               Z = SE3d::exp(small(rng, 1, 0.5));
    Matrix6 Ji, Jj;
    (void)pose_graph_residual<double>(Ti, Tj, Z, &Ji, &Jj);
    const auto by_i = [&](const Vector6& d) -> Vector6 {
      return pose_graph_residual<double>(SE3d::exp(d) * Ti, Tj, Z, nullptr, nullptr);
    };
    const auto by_j = [&](const Vector6& d) -> Vector6 {
      return pose_graph_residual<double>(Ti, SE3d::exp(d) * Tj, Z, nullptr, nullptr);
    };
    const Matrix6 numeric_i = test::central_differences<6, 6>(by_i, Vector6::Zero().eval());
    const Matrix6 numeric_j = test::central_differences<6, 6>(by_j, Vector6::Zero().eval());
    CHECK(test::relative_error(Ji, numeric_i) < 1e-6);
    CHECK(test::relative_error(Jj, numeric_j) < 1e-6);
    CHECK(test::relative_error(Matrix6(-Ji), numeric_i) > 0.1);
  }
}

TEST_CASE("a loop takes the drift out of a ring, and the minimum is Ceres'") {
  test::Rng rng("ring");
  Ring ring(rng, 60);
  const double drifted = end_error(ring);
#ifdef DYNSLAM_HAVE_CERES
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
#endif
  const PoseGraph<double> graph{ring.poses, ring.fixed, ring.edges};
  PoseGraphOptions<double> options;
  options.tolerance = 1e-12;
  const auto result = optimize_pose_graph<double>(graph, options, Huber<double>{3.0});
  CHECK(result.status == PoseGraphStatus::converged);
  CHECK(result.final_cost < 0.5 * result.initial_cost);
  CHECK(end_error(ring) < 0.1 * drifted);
#ifdef DYNSLAM_HAVE_CERES
  ceres::Solver::Options solver;
  solver.max_num_iterations = 200;
  solver.function_tolerance = solver.gradient_tolerance = solver.parameter_tolerance = 1e-14;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  CHECK(result.final_cost == doctest::Approx(2 * summary.final_cost).epsilon(1e-6));
  for (std::size_t k = 0; k < ring.poses.size(); ++k)
    CHECK((ring.poses[k] * SE3d::exp(parameters[k]).inverse()).log().norm() < 1e-5);
#else
  MESSAGE("Ceres was not found: compared with the truth only");
#endif
}

TEST_CASE("a wrong loop bends a least-squares map and hardly a robust one") {
  test::Rng rng("wrong loop");
  Ring robust(rng, 60, true);
  Ring plain = robust, without = robust;
  without.edges.pop_back();
  (void)optimize_pose_graph<double>({robust.poses, robust.fixed, robust.edges}, {}, Cauchy<double>{3.0});
  (void)optimize_pose_graph<double>({plain.poses, plain.fixed, plain.edges}, {}, SquaredLoss<double>{});
  (void)optimize_pose_graph<double>({without.poses, without.fixed, without.edges}, {}, SquaredLoss<double>{});
  const auto middle = [&](const Ring& r) { return (r.poses[30] * without.poses[30].inverse()).log().norm(); };
  CHECK(middle(plain) > 0.2);
  CHECK(middle(robust) < 0.02);
}

TEST_CASE("what cannot be optimised is said") {
  test::Rng rng("pose graph status");
  Ring ring(rng, 10);
  const auto run = [&] {
    return optimize_pose_graph<double>({ring.poses, ring.fixed, ring.edges}, {}, SquaredLoss<double>{})
        .status;
  };
  ring.fixed.assign(10, 0);
  CHECK(run() == PoseGraphStatus::no_gauge);
  ring.fixed.assign(10, 1);
  CHECK(run() == PoseGraphStatus::no_free_pose);
  ring.fixed[3] = 0;
  ring.edges[0].j = 10;
  CHECK(run() == PoseGraphStatus::bad_input);
  ring.edges[0].j = ring.edges[0].i;
  CHECK(run() == PoseGraphStatus::bad_input);
  ring.edges.clear();  // a free pose without an edge stays
  const SE3d before = ring.poses[3];
  CHECK(run() == PoseGraphStatus::converged);
  CHECK((ring.poses[3] * before.inverse()).log().norm() < 1e-14);
}
