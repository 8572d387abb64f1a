// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "dynslam/concepts/robust.hpp"
#include "dynslam/geometry/se3.hpp"

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

template <Scalar S>
struct PoseGraphOptions {
  int max_iterations = 50;  ///< solved systems, refused steps included
  S initial_damping = S(1e-6);
  S tolerance = S(1e-8);  ///< relative decrease of the cost that ends the iteration
};

enum class PoseGraphStatus : std::uint8_t {
  converged,
  max_iterations,  ///< still decreasing; the result is usable
  stalled,         ///< no damping gave a decrease; the poses are those of the last accepted step
  no_free_pose,    ///< nothing to do
  no_gauge,        ///< no pose is fixed
  bad_input        ///< edges out of range or from a pose to itself, or a non-finite cost at the start
};

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

/// Error of an edge: log(T_j_w T_w_i T_i_j), zero where the poses agree with the measurement.
/// @param J_i, J_j  derivatives by left increments of T_i_w and T_j_w; may be null
template <std::floating_point S>
[[nodiscard]] Eigen::Matrix<S, 6, 1> pose_graph_residual(const SE3<S>& T_i_w, const SE3<S>& T_j_w,
                                                         const SE3<S>& T_j_i, Eigen::Matrix<S, 6, 6>* J_i,
                                                         Eigen::Matrix<S, 6, 6>* J_j) {
  const SE3<S> relative = T_j_w * T_i_w.inverse();
  const Eigen::Matrix<S, 6, 1> e = (relative * T_j_i.inverse()).log();
  if (J_i != nullptr || J_j != nullptr) {
    const Eigen::Matrix<S, 6, 6> J = SE3<S>::left_jacobian_inverse(e);
    if (J_i != nullptr) *J_i = -J * relative.adjoint();
    if (J_j != nullptr) *J_j = J;
  }
  return e;
}

/// Poses that agree best with measured relative poses (loop closing): Levenberg-Marquardt on SE(3) with
/// exact Jacobians and a sparse Cholesky factorisation, whose pattern is found once. A robust kernel
/// keeps a wrong loop from bending the map. Poses without an edge stay where they are.
template <std::floating_point S, RobustKernel<S> Kernel>
PoseGraphResult<S> optimize_pose_graph(const PoseGraph<S>& graph, const PoseGraphOptions<S>& options,
                                       const Kernel& kernel) {
  using Matrix6 = Eigen::Matrix<S, 6, 6>;
  using Vector6 = Eigen::Matrix<S, 6, 1>;
  using Index = Eigen::Index;
  PoseGraphResult<S> result;
  const auto count = static_cast<int>(graph.poses.size());
  if (graph.fixed.size() != graph.poses.size()) return result;
  for (const auto& e : graph.edges) {
    if (e.i < 0 || e.j < 0 || e.i >= count || e.j >= count || e.i == e.j) return result;
  }
  std::vector<int> column(graph.poses.size(), -1);
  int free = 0;
  for (std::size_t k = 0; k < graph.poses.size(); ++k) {
    if (graph.fixed[k] == 0) column[k] = free++;
  }
  if (free == 0) {
    result.status = PoseGraphStatus::no_free_pose;
    return result;
  }
  if (free == count) {
    result.status = PoseGraphStatus::no_gauge;
    return result;
  }

  // Pattern of the lower triangle in blocks of six; `entry` finds a block's first value again.
  std::vector<std::vector<int>> rows(static_cast<std::size_t>(free));  // per block column, sorted
  for (int c = 0; c < free; ++c) rows[static_cast<std::size_t>(c)].push_back(c);
  for (const auto& e : graph.edges) {
    const int a = column[static_cast<std::size_t>(e.i)], b = column[static_cast<std::size_t>(e.j)];
    if (a >= 0 && b >= 0) rows[static_cast<std::size_t>(std::min(a, b))].push_back(std::max(a, b));
  }
  Eigen::SparseMatrix<S> H(6 * free, 6 * free);
  {
    std::vector<Eigen::Triplet<S>> triplets;
    for (int c = 0; c < free; ++c) {
      auto& r = rows[static_cast<std::size_t>(c)];
      std::sort(r.begin(), r.end());
      r.erase(std::unique(r.begin(), r.end()), r.end());
      for (const int row : r) {
        for (int x = 0; x < 6; ++x) {
          for (int y = 0; y < 6; ++y) triplets.emplace_back(6 * row + y, 6 * c + x, S(1));
        }
      }
    }
    H.setFromTriplets(triplets.begin(), triplets.end());
  }
  const auto add_block = [&](int row, int c, const Matrix6& block) {
    const auto& r = rows[static_cast<std::size_t>(c)];
    const Index offset = 6 * (std::lower_bound(r.begin(), r.end(), row) - r.begin());
    for (int x = 0; x < 6; ++x) {
      S* values = H.valuePtr() + H.outerIndexPtr()[6 * c + x] + offset;
      for (int y = 0; y < 6; ++y) values[y] += block(y, x);
    }
  };
  const auto diagonal = [&](int k) -> S& {  // of block column k / 6, whose own block comes first
    return H.valuePtr()[H.outerIndexPtr()[k] + k % 6];
  };
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<S>> solver;
  solver.analyzePattern(H);

  const auto cost_of_all = [&] {
    S sum = S(0);
    for (const auto& e : graph.edges) {
      const Vector6 r =
          pose_graph_residual<S>(graph.poses[static_cast<std::size_t>(e.i)],
                                 graph.poses[static_cast<std::size_t>(e.j)], e.T_j_i, nullptr, nullptr);
      sum += kernel.rho(r.dot(e.information * r));
    }
    return sum;
  };
  S cost = cost_of_all();
  result.initial_cost = result.final_cost = cost;
  if (!std::isfinite(cost)) return result;

  using VectorX = Eigen::Matrix<S, Eigen::Dynamic, 1>;
  VectorX b(6 * free), step(6 * free), undamped(6 * free);
  std::vector<SE3<S>> before(graph.poses.begin(), graph.poses.end());
  const auto linearise = [&] {
    std::fill(H.valuePtr(), H.valuePtr() + H.nonZeros(), S(0));
    b.setZero();
    for (const auto& e : graph.edges) {
      std::array<Matrix6, 2> J;
      const Vector6 r =
          pose_graph_residual<S>(graph.poses[static_cast<std::size_t>(e.i)],
                                 graph.poses[static_cast<std::size_t>(e.j)], e.T_j_i, &J[0], &J[1]);
      const Matrix6 information = kernel.weight(r.dot(e.information * r)) * e.information;
      const std::array<int, 2> c{column[static_cast<std::size_t>(e.i)],
                                 column[static_cast<std::size_t>(e.j)]};
      for (std::size_t a = 0; a < 2; ++a) {
        if (c[a] < 0) continue;
        const Matrix6 weighted = J[a].transpose() * information;
        b.template segment<6>(6 * c[a]) -= weighted * r;
        add_block(c[a], c[a], weighted * J[a]);
        if (c[1 - a] >= 0 && c[a] > c[1 - a]) add_block(c[a], c[1 - a], weighted * J[1 - a]);
      }
    }
    for (int k = 0; k < 6 * free; ++k) undamped(k) = diagonal(k);
  };

  S lambda = options.initial_damping;
  result.status = PoseGraphStatus::max_iterations;
  bool fresh = true;
  while (result.iterations < options.max_iterations) {
    if (fresh) linearise();
    ++result.iterations;
    fresh = false;
    // A pose without an edge has a zero block: it gets a unit one and stays.
    for (int k = 0; k < 6 * free; ++k)
      diagonal(k) = undamped(k) > S(0) ? undamped(k) * (S(1) + lambda) : S(1);
    solver.factorize(H);
    bool accepted = false;
    if (solver.info() == Eigen::Success) {
      step = solver.solve(b);
      if (step.allFinite()) {
        std::copy(graph.poses.begin(), graph.poses.end(), before.begin());
        for (std::size_t k = 0; k < graph.poses.size(); ++k) {
          if (column[k] >= 0)
            graph.poses[k] = SE3<S>::exp(step.template segment<6>(6 * column[k])) * graph.poses[k];
        }
        const S trial = cost_of_all();
        accepted = trial <= cost;
        if (accepted) {
          const S decrease = cost - trial;
          cost = trial;
          fresh = true;
          lambda = std::max(lambda * S(0.1), S(1e-12));
          if (decrease <= options.tolerance * cost) {
            result.status = PoseGraphStatus::converged;
            break;
          }
        } else {
          std::copy(before.begin(), before.end(), graph.poses.begin());
        }
      }
    }
    if (!accepted) {
      lambda = std::max(lambda * S(10), S(1e-8));
      if (lambda > S(1e8)) {
        result.status = PoseGraphStatus::stalled;
        break;
      }
    }
  }
  result.final_cost = cost;
  return result;
}

}  // namespace dynslam
