// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "dynslam/concepts/robust.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/optim/block_sparse_system.hpp"
#include "dynslam/optim/levenberg_marquardt.hpp"
#include "dynslam/optim/normal_equations.hpp"
#include "dynslam/robust/kernels.hpp"

namespace dynslam {

/// A measured relative pose of two cameras.
template <Scalar S>
struct PoseGraphEdge {
  int i = 0, j = 0;
  SE3<S> T_j_i;
  Eigen::Matrix<S, 6, 6> information =
      Eigen::Matrix<S, 6, 6>::Identity();  ///< of [upsilon; omega] at camera j
};

/// Poses T_c_w are changed in place; the spans must outlive the call.
template <Scalar S>
struct PoseGraph {
  std::span<SE3<S>> poses;              ///< T_c_w
  std::span<const std::uint8_t> fixed;  ///< per pose: nonzero = not changed (the gauge)
  std::span<const PoseGraphEdge<S>> edges;
};

/// Options of optimize_pose_graph.
template <Scalar S>
struct PoseGraphOptions {
  int max_iterations = 50;  ///< solved systems, refused steps included
  S initial_damping = S(1e-6);
  S tolerance = S(1e-8);            ///< relative decrease of the cost that ends the iteration
  S min_damping = S(1e-12);         ///< of Levenberg-Marquardt (see there)
  S min_refused_damping = S(1e-8);  ///< the damping starts so low that it would take long to rise otherwise
  S max_damping = S(1e8);           ///< beyond, the graph has stalled
};

/// How optimize_pose_graph ended.
enum class PoseGraphStatus : std::uint8_t {
  converged,
  max_iterations,  ///< still decreasing; the result is usable
  stalled,         ///< no damping gave a decrease; the poses are those of the last accepted step
  no_free_pose,    ///< nothing to do
  no_gauge,        ///< no pose is fixed
  bad_input        ///< sizes that disagree, edges out of range or from a pose to itself, or a non-finite cost
};

/// What optimize_pose_graph did; the poses are changed in place.
template <Scalar S>
struct PoseGraphResult {
  PoseGraphStatus status = PoseGraphStatus::bad_input;
  S initial_cost = S(0), final_cost = S(0);  ///< sum of rho over the edges
  int iterations = 0;
  [[nodiscard]] bool ok() const {
    return status == PoseGraphStatus::converged || status == PoseGraphStatus::max_iterations ||
           status == PoseGraphStatus::stalled;
  }
};

/// Memory of optimize_pose_graph; keep it between calls. The order of a new graph allocates in every call.
template <Scalar S>
struct PoseGraphWorkspace {
  std::vector<int> column;                // per pose: index among the free ones, -1 fixed
  std::vector<std::array<int, 2>> pairs;  // free poses with an edge between them
  std::vector<std::size_t> place;         // per edge: its block in H
  std::vector<SE3<S>> before;             // poses before the trial step
  BlockSparseSystem<S, 6> H;
  std::vector<S> b, step, undamped;
};

/// Error of an edge: log(T_j_w T_w_i T_i_j), zero where the poses agree with the measurement.
/// @param J_i, J_j  derivatives by left increments of T_i_w and T_j_w; may be null
template <Scalar S>
[[nodiscard]] Eigen::Matrix<S, 6, 1> pose_graph_residual(const SE3<S>& T_i_w, const SE3<S>& T_j_w,
                                                         const SE3<S>& T_j_i, Eigen::Matrix<S, 6, 6>* J_i,
                                                         Eigen::Matrix<S, 6, 6>* J_j) {
  const SE3<S> relative = T_j_w * T_i_w.inverse();
  const Eigen::Matrix<S, 6, 1> e = (relative * T_j_i.inverse()).log();
  if (J_i != nullptr || J_j != nullptr) {
    Eigen::Matrix<S, 6, 6> J = SE3<S>::left_jacobian_inverse(e);
    if (J_j != nullptr) *J_j = J;
    if (J_i != nullptr) {
      for (int k = 0; k < 36; ++k) J.data()[k] = -J.data()[k];
      *J_i = detail::product6<S>(J, relative.adjoint());
    }
  }
  return e;
}

namespace detail {

/// The poses of a graph as a LeastSquaresProblem.
template <std::floating_point S, class Kernel>
class PoseGraphSolver {
 public:
  PoseGraphSolver(const PoseGraph<S>& graph, const PoseGraphOptions<S>& options, const Kernel& kernel,
                  PoseGraphWorkspace<S>& workspace)
      : graph_(graph), options_(options), kernel_(kernel), ws_(workspace) {}

  /// Checks the graph and finds the pattern of its system. @return what stands against it, if anything does
  [[nodiscard]] std::optional<PoseGraphStatus> prepare() {
    const auto count = static_cast<int>(graph_.poses.size());
    if (graph_.fixed.size() != graph_.poses.size()) return PoseGraphStatus::bad_input;
    for (const auto& e : graph_.edges) {
      if (e.i < 0 || e.j < 0 || e.i >= count || e.j >= count || e.i == e.j) return PoseGraphStatus::bad_input;
    }
    ws_.column.assign(graph_.poses.size(), -1);
    free_ = 0;
    for (std::size_t k = 0; k < graph_.poses.size(); ++k) {
      if (graph_.fixed[k] == 0) ws_.column[k] = free_++;
    }
    if (free_ == 0) return PoseGraphStatus::no_free_pose;
    if (free_ == count) return PoseGraphStatus::no_gauge;
    find_pattern();
    const std::size_t unknowns = 6 * static_cast<std::size_t>(free_);
    ws_.b.resize(unknowns);
    ws_.step.resize(unknowns);
    ws_.undamped.resize(unknowns);
    ws_.before.assign(graph_.poses.begin(), graph_.poses.end());
    return std::nullopt;
  }

  /// Cost at the start.
  [[nodiscard]] S start() const { return cost(); }

  [[nodiscard]] S cost() const {
    S sum = S(0);
    for (const auto& e : graph_.edges) {
      const Vector6 r = pose_graph_residual<S>(pose(e.i), pose(e.j), e.T_j_i, nullptr, nullptr);
      sum += kernel_.rho(chi2(e, r));
    }
    return sum;
  }

  void linearise() {
    ws_.H.set_zero();
    std::fill(ws_.b.begin(), ws_.b.end(), S(0));
    for (std::size_t k = 0; k < graph_.edges.size(); ++k) add_edge(graph_.edges[k], ws_.place[k]);
    for (std::size_t k = 0; k < ws_.undamped.size(); ++k) ws_.undamped[k] = diagonal(k);
  }

  [[nodiscard]] bool solve(const S& lambda) {
    // A pose without an edge has a zero block: it gets a unit one and stays.
    for (std::size_t k = 0; k < ws_.undamped.size(); ++k)
      diagonal(k) = ws_.undamped[k] > S(0) ? ws_.undamped[k] * (S(1) + lambda) : S(1);
    if (!ws_.H.factor()) return false;
    ws_.step = ws_.b;
    ws_.H.solve(ws_.step);
    return all_finite(ws_.step.data(), static_cast<Eigen::Index>(ws_.step.size()));
  }

  [[nodiscard]] S apply() {
    std::copy(graph_.poses.begin(), graph_.poses.end(), ws_.before.begin());
    for (std::size_t k = 0; k < graph_.poses.size(); ++k) {
      if (ws_.column[k] < 0) continue;
      const Vector6 delta(ws_.step.data() + 6 * ws_.column[k]);
      graph_.poses[k] = SE3<S>::exp(delta) * graph_.poses[k];
    }
    return cost();
  }
  S accept(const S& trial) { return trial; }
  void restore() { std::copy(ws_.before.begin(), ws_.before.end(), graph_.poses.begin()); }
  [[nodiscard]] bool converged(bool moved, const S& decrease, const S& cost) const {
    return moved && decrease <= options_.tolerance * cost;
  }

 private:
  using Matrix6 = Eigen::Matrix<S, 6, 6>;
  using Vector6 = Eigen::Matrix<S, 6, 1>;

  [[nodiscard]] const SE3<S>& pose(int k) const { return graph_.poses[static_cast<std::size_t>(k)]; }
  [[nodiscard]] int column(int k) const { return ws_.column[static_cast<std::size_t>(k)]; }
  [[nodiscard]] static S chi2(const PoseGraphEdge<S>& e, const Vector6& r) {
    return dot6(r.data(), product6<S>(e.information, r).data());
  }

  void find_pattern() {
    ws_.pairs.clear();
    for (const auto& e : graph_.edges) {
      if (column(e.i) >= 0 && column(e.j) >= 0) ws_.pairs.push_back({column(e.i), column(e.j)});
    }
    ws_.H.reset(free_, ws_.pairs);
    ws_.place.assign(graph_.edges.size(), 0);
    for (std::size_t k = 0; k < graph_.edges.size(); ++k) {
      const int a = column(graph_.edges[k].i), b = column(graph_.edges[k].j);
      if (a >= 0 && b >= 0) ws_.place[k] = ws_.H.place(std::max(a, b), std::min(a, b));
    }
  }

  void add_edge(const PoseGraphEdge<S>& e, std::size_t place) {
    std::array<Matrix6, 2> J;
    const Vector6 r = pose_graph_residual<S>(pose(e.i), pose(e.j), e.T_j_i, &J[0], &J[1]);
    const S weight = kernel_.weight(chi2(e, r));
    Matrix6 information;
    for (int k = 0; k < 36; ++k) information.data()[k] = weight * e.information.data()[k];
    const std::array<int, 2> c{column(e.i), column(e.j)};
    for (std::size_t a = 0; a < 2; ++a) {
      if (c[a] < 0) continue;
      const Matrix6 weighted = transposed_product6<S>(J[a], information);
      const Vector6 force = product6<S>(weighted, r);
      for (int k = 0; k < 6; ++k) ws_.b[static_cast<std::size_t>(6 * c[a] + k)] -= force(k);
      add_block(ws_.H.diagonal(c[a]), product6<S>(weighted, J[a]));
      if (c[1 - a] >= 0 && c[a] > c[1 - a]) add_block(place, product6<S>(weighted, J[1 - a]));
    }
  }
  void add_block(std::size_t place, const Matrix6& block) {
    auto& to = ws_.H.block(place);
    for (std::size_t k = 0; k < to.size(); ++k) to[k] += block.data()[k];
  }
  [[nodiscard]] S& diagonal(std::size_t k) {
    return ws_.H.block(ws_.H.diagonal(static_cast<int>(k / 6)))[7 * (k % 6)];
  }

  const PoseGraph<S>& graph_;
  const PoseGraphOptions<S>& options_;
  const Kernel& kernel_;
  PoseGraphWorkspace<S>& ws_;
  int free_ = 0;
};

}  // namespace detail

/// Poses that agree best with measured relative poses (loop closing): Levenberg-Marquardt on SE(3) with
/// exact Jacobians and a sparse Cholesky factorisation, whose pattern is found once. A robust kernel
/// keeps a wrong loop from bending the map. Poses without an edge stay where they are.
template <std::floating_point S, RobustKernel<S> Kernel>
PoseGraphResult<S> optimize_pose_graph(const PoseGraph<S>& graph, const PoseGraphOptions<S>& options,
                                       const Kernel& kernel, PoseGraphWorkspace<S>& workspace) {
  detail::PoseGraphSolver<S, Kernel> solver(graph, options, kernel, workspace);
  return minimise<PoseGraphResult<S>, S>(solver, options);
}

/// The same with memory of its own.
template <std::floating_point S, RobustKernel<S> Kernel = SquaredLoss<S>>
PoseGraphResult<S> optimize_pose_graph(const PoseGraph<S>& graph, const PoseGraphOptions<S>& options = {},
                                       const Kernel& kernel = {}) {
  PoseGraphWorkspace<S> workspace;
  return optimize_pose_graph(graph, options, kernel, workspace);
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
