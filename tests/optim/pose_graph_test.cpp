// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/optim/pose_graph.hpp"

#include <doctest/doctest.h>

#include <vector>

#include "dynslam/robust/kernels.hpp"
#include "jacobian.hpp"
#include "pose_ring.hpp"
#include "random.hpp"

using namespace dynslam;

using test::end_error;
using test::Matrix6;
using test::Ring;
using test::small;
using test::Vector6;

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

TEST_CASE("a loop takes the drift out of a ring") {
  test::Rng rng("ring");
  Ring ring(rng, 60);
  const double drifted = end_error(ring);
  const PoseGraph<double> graph{ring.poses, ring.fixed, ring.edges};
  PoseGraphOptions<double> options;
  options.tolerance = 1e-12;
  const auto result = optimize_pose_graph<double>(graph, options, Huber<double>{3.0});
  CHECK(result.status == PoseGraphStatus::converged);
  CHECK(result.final_cost < 0.5 * result.initial_cost);
  CHECK(end_error(ring) < 0.1 * drifted);
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

TEST_CASE("a reused workspace gives the same graph, also after one of another size") {
  test::Rng rng("graph reuse");
  Ring ring(rng, 40), small(rng, 12), again = ring;
  PoseGraphWorkspace<double> workspace;
  const auto run = [&](Ring& r) {
    return optimize_pose_graph<double>({r.poses, r.fixed, r.edges}, {}, Huber<double>{3.0}, workspace);
  };
  const auto first = run(ring);
  CHECK(run(small).ok());
  const auto second = run(again);
  CHECK(first.final_cost == second.final_cost);
  CHECK(first.iterations == second.iterations);
  for (std::size_t k = 0; k < ring.poses.size(); ++k)
    CHECK(ring.poses[k].matrix() == again.poses[k].matrix());
}

TEST_CASE("in float, a ring loses its drift as in double") {
  test::Rng rng("graph float");
  Ring ring(rng, 60);
  const double drifted = end_error(ring);
  std::vector<SE3<float>> poses;
  std::vector<PoseGraphEdge<float>> edges;
  for (const SE3d& T : ring.poses) poses.push_back(T.cast<float>());
  for (const auto& e : ring.edges)
    edges.push_back({e.i, e.j, e.T_j_i.cast<float>(), e.information.cast<float>()});
  const auto result = optimize_pose_graph<float>({poses, ring.fixed, edges});
  CHECK(result.ok());
  CHECK(result.final_cost < 0.5F * result.initial_cost);
  for (std::size_t k = 0; k < poses.size(); ++k) ring.poses[k] = poses[k].cast<double>();
  CHECK(end_error(ring) < 0.1 * drifted);
}
