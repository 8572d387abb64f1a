// SPDX-License-Identifier: BSD-3-Clause
// Estimators of one pose.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "dynslam/geometry/p3p.hpp"
#include "dynslam/optim/absolute_pose.hpp"
#include "dynslam/optim/banded_system.hpp"
#include "dynslam/optim/block_sparse_system.hpp"
#include "dynslam/optim/pose.hpp"
#include "dynslam/optim/pose_consensus.hpp"
#include "dynslam/optim/pose_step.hpp"
#include "dynslam/optim/rolling_pose.hpp"
#include "dynslam/optim/surface_weights.hpp"
#include "dynslam/optim/trajectory_smoothing.hpp"
#include "dynslam/optim/truncated_cost.hpp"
#include "dynslam/robust/kernels.hpp"
#include "dynslam/robust/t_distribution.hpp"
#include "scene.hpp"

using namespace dynslam;
using test::points;
using test::pose_of;
using test::put_pose;

namespace {

template <class Camera>
std::vector<PoseObservation<typename Camera::ScalarType>> sights(const Camera& camera,
                                                                 const SE3<typename Camera::ScalarType>& T) {
  using S = typename Camera::ScalarType;
  std::vector<PoseObservation<S>> all;
  for (const auto& p : points()) {
    PoseObservation<S> o;
    o.p_w = p.cast<S>();
    const Eigen::Matrix<S, 3, 1> p_c = T * o.p_w;
    const auto x = camera.project(p_c);
    REQUIRE(x.has_value());
    o.x = *x;
    if (all.size() % 8 == 0) o.x.y() += S(15);  // a wrong match
    o.depth = p_c.z();
    o.inv_sigma_z2 = S(400);
    all.push_back(o);
  }
  return all;
}

template <class Camera>
void poses(test::Record<double>& out) {
  using S = typename Camera::ScalarType;
  const auto camera = test::conformance_camera<Camera>();
  const SE3<S> truth = pose_of(1).cast<S>(), start = pose_of(0.9).cast<S>();
  const auto observations = sights(camera, truth);
  const std::span<const PoseObservation<S>> view(observations);
  PoseWorkspace<S> workspace;
  const auto with = [&](const auto& kernel) {
    const auto result = optimize_pose(camera, view, start, PoseOptions<S>{}, kernel, workspace);
    out.put("optimize_pose.ok", result.ok());
    out.put("optimize_pose.inliers", result.inliers);
    put_pose(out, "optimize_pose", result.T_c_w);
  };
  with(TDistribution<S>::with_dimension(S(5), 1));
  with(Tukey<S>());
  put_pose(out, "optimize_pose.short", optimize_pose(camera, view, start).T_c_w);
  std::vector<S> rows;
  for (std::size_t i = 0; i < view.size(); ++i) rows.push_back(S(i % 11) / S(10) - S(0.5));
  const std::span<const S> share(rows);
  const auto rolling = optimize_rolling_pose(camera, view, share, start, {.sigma = S(1e-4)}, PoseOptions<S>{},
                                             Tukey<S>(), workspace);
  out.put("optimize_rolling_pose.inliers", rolling.inliers);
  put_pose(out, "optimize_rolling_pose", rolling.T_c_w);
  put_pose(out, "optimize_rolling_pose.short", optimize_rolling_pose(camera, view, share, start).T_c_w);
  std::vector<S> weights;
  surface_weights<S>(test::kWidth, test::kHeight, start, view, {}, weights);
  out.put("surface_weights",
          weights.size() == view.size() && *std::min_element(weights.begin(), weights.end()) > 0);
  PoseConsensusWorkspace consensus;
  PoseConsensusOptions<S> few;
  few.hypotheses = 40;
  const std::array<SE3<S>, 1> others{SE3<S>()};
  const auto agreed =
      pose_consensus(camera, view, std::span<const S>(weights), start, others, few, consensus);
  out.put("pose_consensus.inliers", agreed.inliers);
  put_pose(out, "pose_consensus", agreed.T_c_w);
  put_pose(out, "pose_consensus.short", pose_consensus(camera, view, start, few).T_c_w);
  const auto cost = truncated_cost<S>(
      camera, truth, view, S(6), [&](std::size_t k) { return weights[k]; }, S(0), S(1e9));
  out.put("truncated_cost.inliers", cost ? cost->inliers : 0);
  AbsolutePoseWorkspace absolute;
  const auto found = absolute_pose(camera, view, AbsolutePoseOptions<S>{}, absolute);
  out.put("absolute_pose.inliers", found.inliers);
  put_pose(out, "absolute_pose", found.T_c_w);
  put_pose(out, "absolute_pose.short", absolute_pose(camera, view).T_c_w);
  std::vector<PoseObservation<S>> pixels(view.begin(), view.end());
  for (auto& o : pixels) o.inv_sigma_z2 = S(0);
  put_pose(out, "absolute_pose.pixels", absolute_pose<S>(camera, pixels).T_c_w);
}

template <class S>
void trajectories(test::Record<double>& out) {
  std::vector<TrackedPose<S>> all(40);
  for (std::size_t i = 0; i < all.size(); ++i) {
    all[i].t = static_cast<double>(i) / 30;
    all[i].T_c_w = pose_of(0.02 * static_cast<double>(i)).template cast<S>();
  }
  const auto smoothed = smooth_trajectory<S>(all);
  out.put("smooth_trajectory.ok", smoothed.ok());
  put_pose(out, "smooth_trajectory", all[20].T_c_w);
  BandedSystem<S, 1> chain;
  chain.reset(2);
  chain.at(0, 0) = chain.at(1, 0) = S(2);
  chain.at(0, 1) = S(1);
  out.put("banded_system.factor", chain.factor());
  BlockSparseSystem<S, 1> graph;
  graph.reset(3, std::array<std::array<int, 2>, 2>{{{0, 2}, {2, 1}}});
  for (int k = 0; k < 3; ++k) graph.block(graph.diagonal(k))[0] = S(2);
  graph.block(graph.place(2, 0))[0] = graph.block(graph.place(2, 1))[0] = S(1);
  out.put("block_sparse_system.factor", graph.factor());
  std::array<S, 3> x{S(1), S(2), S(3)};
  graph.solve(x);
  out.put("block_sparse_system.solve", static_cast<double>(x[2]));
}

template <class Camera>
test::Record<double> camera_results() {
  test::Record<double> out;
  poses<Camera>(out);
  trajectories<typename Camera::ScalarType>(out);
  return out;
}

}  // namespace

TEST_CASE_TEMPLATE("one pose has the same answer with every camera, in float and double", Camera,
                   DYNSLAM_CONFORMANCE_CAMERAS) {
  static const auto expected = camera_results<Pinhole<double>>();
  test::check_same(camera_results<Camera>(), expected, 3e-3);
}
