// SPDX-License-Identifier: BSD-3-Clause
// Estimators without a camera.
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "dynslam/dynamics/classify.hpp"
#include "dynslam/eval/reliability.hpp"
#include "dynslam/eval/trajectory.hpp"
#include "dynslam/geometry/rigid_alignment.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/geometry/small_cholesky.hpp"
#include "dynslam/optim/levenberg_marquardt.hpp"
#include "dynslam/optim/normal_equations.hpp"
#include "dynslam/optim/pose_graph.hpp"
#include "dynslam/robust/chi_square.hpp"
#include "dynslam/robust/consensus.hpp"
#include "dynslam/robust/kernels.hpp"
#include "dynslam/robust/rho_sum.hpp"
#include "dynslam/robust/split_mix64.hpp"
#include "dynslam/robust/t_distribution.hpp"
#include "scene.hpp"

using namespace dynslam;
using test::points;
using test::pose_of;
using test::put_pose;

namespace {

template <std::floating_point S>
void statistics_of(test::Record<double>& out) {
  test::Rng rng("conformance statistics");
  std::vector<S> residuals;
  std::vector<Eigen::Matrix<S, 3, 1>> vectors;
  for (int i = 0; i < 200; ++i) {
    residuals.push_back(S(rng.normal()));
    vectors.push_back(Eigen::Vector3d(rng.normal(), 2 * rng.normal(), rng.normal()).cast<S>());
  }
  const std::vector<std::uint8_t> excluded(residuals.size(), 0);
  ScaleWorkspace<S> workspace;
  const std::span<const S> r(residuals);
  out.put("estimate_scale",
          static_cast<double>(*estimate_scale<S>(r, excluded, ScaleOptions<S>{}, workspace)));
  out.put("estimate_scale.short", static_cast<double>(*estimate_scale<S>(r, S(5))));
  const Eigen::Matrix<S, 3, 3> one = Eigen::Matrix<S, 3, 3>::Identity();
  out.put("estimate_covariance",
          estimate_covariance<S, 3>(std::span<const Eigen::Matrix<S, 3, 1>>(vectors), one, S(5))
              ->template cast<double>());
  std::vector<std::uint8_t> dynamic(residuals.size());
  out.put("classify", static_cast<double>(classify<S>(r, S(0), dynamic)));
  out.put("is_dynamic", is_dynamic(S(0.1), S(0.25)));
  out.put("statistics", static_cast<double>(statistics<S>(r).rmse));
  ReliabilityDiagram diagram;
  for (const S e : r) diagram.add(e, e > S(0.5));
  out.put("reliability", diagram.largest_error());
  RhoSum<S, TDistribution<S>> joint{TDistribution<S>::with_dimension(S(5), 1)};
  const Huber<S> huber;
  RhoSum<S, Huber<S>> one_by_one(huber);
  for (const S e : r) {
    joint.add(e * e);
    one_by_one.add(e * e);
  }
  out.put("rho_sum", static_cast<double>(joint.value() + one_by_one.value()));
  SplitMix64 random(3);
  out.put("unit", static_cast<double>(random.unit<S>()));
  out.put("samples_needed", samples_needed<3>(S(0.5), S(0.99), 1000));
  out.put("chi_square", kChiSquare95<2>);
  NormalEquations<S, 2> system;
  system.add_row(Eigen::Matrix<S, 1, 2>(S(1), S(2)), S(1), S(1));
  system.add_row(Eigen::Matrix<S, 1, 2>(S(2), S(1)), S(3), S(1));
  Eigen::Matrix<S, 2, 1> step;
  Eigen::Matrix<S, 2, 2> covariance;
  REQUIRE(system.solve(S(0), step));
  REQUIRE(system.covariance(covariance));
  SmallCholesky<S, 2> factor;
  REQUIRE(factor.compute(covariance));
  out.put("small_cholesky.solve", factor.solve(step).template cast<double>());
  out.put("small_cholesky.inverse", factor.inverse().template cast<double>());
  out.put("normal_equations", step.template cast<double>());
  out.put("normal_equations.covariance", covariance.template cast<double>());
}

template <std::floating_point S>
void graphs_and_trajectories(test::Record<double>& out) {
  std::vector<SE3<S>> graph;
  std::vector<std::uint8_t> fixed(6, 0);
  std::vector<PoseGraphEdge<S>> edges;
  std::vector<StampedPose<S>> truth, estimate;
  for (int i = 0; i < 6; ++i) {
    graph.push_back(pose_of(1.0 * i).cast<S>());
    truth.push_back({1e9 + 0.5 * i, graph.back().inverse()});
    for (int j = 0; j < i; ++j)
      edges.push_back({j, i, graph[std::size_t(i)] * graph[std::size_t(j)].inverse()});
  }
  fixed[0] = 1;
  for (std::size_t i = 1; i < 6; ++i) graph[i] = pose_of(1.0 * static_cast<double>(i) + 0.1).cast<S>();
  for (std::size_t i = 0; i < 6; ++i) estimate.push_back({truth[i].t, graph[i].inverse()});
  auto again = graph;
  PoseGraphWorkspace<S> workspace;
  const auto result =
      optimize_pose_graph(PoseGraph<S>{graph, fixed, edges}, PoseGraphOptions<S>{}, Cauchy<S>(), workspace);
  out.put("pose_graph.ok", result.ok());
  put_pose(out, "pose_graph", graph[5]);
  out.put("pose_graph.short", optimize_pose_graph(PoseGraph<S>{again, fixed, edges}).ok());
  using Stamped = std::span<const StampedPose<S>>;
  const auto ate = absolute_trajectory_error<S>(Stamped(estimate), Stamped(truth));
  REQUIRE(ate.has_value());
  out.put("ate", static_cast<double>(ate->translation.rmse));
  const auto rpe = relative_pose_error<S>(Stamped(estimate), Stamped(truth), 0.5);
  REQUIRE(rpe.has_value());
  out.put("rpe", static_cast<double>(rpe->translation.rmse));
  out.put("end_error", static_cast<double>(*end_error<S>(Stamped(estimate), Stamped(truth))));
  out.put("improvement", static_cast<double>(improvement_percent(S(2), S(1))));
  std::vector<Eigen::Matrix<S, 3, 1>> a, b;
  for (const auto& p : points()) {
    a.push_back(p.cast<S>());
    b.push_back(truth[1].T_w_c * a.back());
  }
  using Points3 = std::span<const Eigen::Matrix<S, 3, 1>>;
  const auto aligned = horn_alignment<S>(Points3(a), Points3(b));
  REQUIRE(aligned.has_value());
  put_pose(out, "horn_alignment", *aligned);
}

template <std::floating_point S>
test::Record<double> other_results() {
  test::Record<double> out;
  statistics_of<S>(out);
  graphs_and_trajectories<S>(out);
  return out;
}

}  // namespace

TEST_CASE("estimators without a camera have the same answer in float and double") {
  test::check_same(other_results<float>(), other_results<double>(), 2e-3);
}
