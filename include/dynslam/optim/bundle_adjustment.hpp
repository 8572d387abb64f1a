// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "dynslam/concepts/robust.hpp"
#include "dynslam/optim/pose.hpp"

namespace dynslam {

/// One sight of a point: which pose, which point, where, how far.
template <Scalar S>
struct BundleObservation {
  int pose = 0, point = 0;
  Eigen::Matrix<S, 2, 1> x;  ///< ideal (undistorted) pixel
  S depth = S(0);            ///< along the optical axis [m]; invalid: reprojection only
  S inv_sigma_px2 = S(1);    ///< [1/px^2]
  S inv_sigma_z2 = S(0);     ///< [1/m^2]
};

/// What is adjusted. The spans must outlive the call; poses and points are changed in place.
template <Scalar S>
struct BundleProblem {
  std::span<SE3<S>> poses;                             ///< T_c_w
  std::span<const std::uint8_t> fixed;                 ///< per pose: nonzero = not changed (the gauge)
  std::span<Eigen::Matrix<S, 3, 1>> points;            ///< world [m]
  std::span<const BundleObservation<S>> observations;  ///< sorted by point
};

template <Scalar S>
struct BundleOptions {
  int max_iterations = 10;  ///< solved systems, refused steps included
  S initial_damping = S(1e-4);
  S tolerance = S(1e-6);  ///< relative decrease of the cost that ends the iteration
};

enum class BundleStatus : std::uint8_t {
  converged,
  max_iterations,  ///< still decreasing; the result is usable
  stalled,         ///< no damping gave a decrease; the parameters are those of the last accepted step
  no_free_pose,    ///< nothing to do
  no_gauge,        ///< no pose is fixed
  bad_input        ///< observations unsorted or out of range, or a non-finite cost at the start
};

template <Scalar S>
struct BundleResult {
  BundleStatus status = BundleStatus::bad_input;
  S initial_cost = S(0), final_cost = S(0);  ///< sum of rho over the observations in front of their cameras
  int iterations = 0;
  [[nodiscard]] bool ok() const {
    return status == BundleStatus::converged || status == BundleStatus::max_iterations ||
           status == BundleStatus::stalled;
  }
};

/// Memory of bundle_adjust; keep it between calls: nothing is allocated while iterating.
template <Scalar S>
struct BundleWorkspace {
  using Matrix63 = Eigen::Matrix<S, 6, 3>;
  std::vector<int> column;             // per pose: index among the free ones, -1 fixed
  std::vector<std::uint8_t> in_front;  // per observation: has been in front of its camera
  std::vector<Matrix63, Eigen::aligned_allocator<Matrix63>> W;  // per observation: J_pose^T J_point
  std::vector<Eigen::Matrix<S, 3, 3>> V, V_inverse;             // per point
  std::vector<Eigen::Matrix<S, 3, 1>> b_point;
  std::vector<Eigen::Matrix<S, 6, 6>> U;  // per free pose
  std::vector<Eigen::Matrix<S, 6, 1>> b_pose;
  std::vector<SE3<S>> poses;  // before the trial step
  std::vector<Eigen::Matrix<S, 3, 1>> points;
  Eigen::Matrix<S, Eigen::Dynamic, Eigen::Dynamic> reduced;
  Eigen::Matrix<S, Eigen::Dynamic, 1> rhs, step;
  Eigen::LLT<Eigen::Matrix<S, Eigen::Dynamic, Eigen::Dynamic>> factor;
};

/// Squared normalised error of an observation; infinity behind the camera.
template <std::floating_point S>
[[nodiscard]] S bundle_chi2(const Pinhole<S>& camera, const SE3<S>& T_c_w, const Eigen::Matrix<S, 3, 1>& p_w,
                            const BundleObservation<S>& o) {
  return observation_chi2<S>(camera, T_c_w, {p_w, o.x, o.depth, o.inv_sigma_px2, o.inv_sigma_z2});
}

/// Poses and points that minimise the robust reprojection and depth errors (Eqs 5 and 6 over a window
/// of keyframes), by Levenberg-Marquardt. The points are eliminated (Schur complement), which leaves a
/// dense system of six unknowns per free pose; meant for windows of up to some tens of poses.
/// An observation that is behind its camera at the start does not count until a step brings it in front; a
/// step that puts any other one there is refused, or hiding points would be a way to a low cost.
template <std::floating_point S, RobustKernel<S> Kernel>
BundleResult<S> bundle_adjust(const Pinhole<S>& camera, const BundleProblem<S>& problem,
                              const BundleOptions<S>& options, const Kernel& kernel, BundleWorkspace<S>& ws) {
  using Matrix3 = Eigen::Matrix<S, 3, 3>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  using Vector6 = Eigen::Matrix<S, 6, 1>;
  BundleResult<S> result;
  const auto& observations = problem.observations;
  const auto pose_count = static_cast<int>(problem.poses.size()),
             point_count = static_cast<int>(problem.points.size());
  if (problem.fixed.size() != problem.poses.size()) return result;
  for (std::size_t k = 0; k < observations.size(); ++k) {
    const auto& o = observations[k];
    if (o.pose < 0 || o.pose >= pose_count || o.point < 0 || o.point >= point_count) return result;
    if (!o.x.allFinite()) return result;
    if (k > 0 && o.point < observations[k - 1].point) return result;
  }
  int free = 0;
  ws.column.assign(problem.poses.size(), -1);
  for (std::size_t i = 0; i < problem.poses.size(); ++i) {
    if (problem.fixed[i] == 0) ws.column[i] = free++;
  }
  if (free == 0) {
    result.status = BundleStatus::no_free_pose;
    return result;
  }
  if (free == pose_count) {
    result.status = BundleStatus::no_gauge;
    return result;
  }

  ws.W.resize(observations.size());
  ws.V.resize(problem.points.size());
  ws.V_inverse.resize(problem.points.size());
  ws.b_point.resize(problem.points.size());
  ws.U.resize(static_cast<std::size_t>(free));
  ws.b_pose.resize(static_cast<std::size_t>(free));
  ws.poses.resize(problem.poses.size());
  ws.points.resize(problem.points.size());
  ws.reduced.resize(6 * free, 6 * free);
  ws.rhs.resize(6 * free);
  ws.step.resize(6 * free);

  constexpr S kInfinity = std::numeric_limits<S>::infinity();
  struct Cost {
    S known = S(0);  // of the observations that counted before
    S all =
        S(0);  // and of those that have come in front of their camera, which the known ones cannot pay for
  };
  const auto chi2 = [&](const BundleObservation<S>& o) {
    return bundle_chi2<S>(camera, problem.poses[static_cast<std::size_t>(o.pose)],
                          problem.points[static_cast<std::size_t>(o.point)], o);
  };
  const auto cost_now = [&] {
    Cost sum;
    for (std::size_t k = 0; k < observations.size(); ++k) {
      const S e = chi2(observations[k]);
      if (e == kInfinity) {
        if (ws.in_front[k] == 0) continue;
        sum.known = sum.all = kInfinity;
        break;
      }
      const S rho = kernel.rho(e);
      if (ws.in_front[k] != 0) sum.known += rho;
      sum.all += rho;
    }
    return sum;
  };
  const auto mark_in_front = [&] {
    for (std::size_t k = 0; k < observations.size(); ++k) {
      if (ws.in_front[k] == 0 && chi2(observations[k]) != kInfinity) ws.in_front[k] = 1;
    }
  };
  ws.in_front.assign(observations.size(), 0);
  mark_in_front();
  S cost = cost_now().all;
  result.initial_cost = result.final_cost = cost;
  if (!std::isfinite(cost)) return result;

  const auto linearise = [&] {
    for (auto& U : ws.U) U.setZero();
    for (auto& b : ws.b_pose) b.setZero();
    for (auto& V : ws.V) V.setZero();
    for (auto& b : ws.b_point) b.setZero();
    for (std::size_t k = 0; k < observations.size(); ++k) {
      const auto& o = observations[k];
      const auto j = static_cast<std::size_t>(o.point);
      const SE3<S>& T = problem.poses[static_cast<std::size_t>(o.pose)];
      const PoseObservation<S> single{problem.points[j], o.x, o.depth, o.inv_sigma_px2, o.inv_sigma_z2};
      Vector3 r;
      Eigen::Matrix<S, 3, 6> J;
      ws.W[k].setZero();
      if (!pose_residual<S>(camera, T, single, r, &J)) continue;
      const bool depth = o.inv_sigma_z2 > S(0) && is_valid_depth(o.depth);
      const S e =
          o.inv_sigma_px2 * (r.x() * r.x() + r.y() * r.y()) + (depth ? o.inv_sigma_z2 * r.z() * r.z() : S(0));
      const S weight = kernel.weight(e);
      const Vector3 information(weight * o.inv_sigma_px2, weight * o.inv_sigma_px2,
                                depth ? weight * o.inv_sigma_z2 : S(0));
      // The left three columns of J are the derivative by the point in the camera frame.
      const Matrix3 J_point = J.template leftCols<3>() * T.rotation_matrix();
      const Eigen::Matrix<S, 3, 3> weighted = information.asDiagonal() * J_point;
      ws.V[j].noalias() += J_point.transpose() * weighted;
      ws.b_point[j].noalias() += weighted.transpose() * r;
      const int c = ws.column[static_cast<std::size_t>(o.pose)];
      if (c < 0) continue;
      ws.W[k].noalias() = J.transpose() * weighted;
      const Eigen::Matrix<S, 3, 6> weighted_pose = information.asDiagonal() * J;
      ws.U[static_cast<std::size_t>(c)].noalias() += J.transpose() * weighted_pose;
      ws.b_pose[static_cast<std::size_t>(c)].noalias() += weighted_pose.transpose() * r;
    }
  };

  // A point that no free pose sees keeps its V, so it is adjusted, too; one without information stays.
  const auto solve = [&](S lambda) {
    ws.reduced.setZero();
    for (int c = 0; c < free; ++c) {
      Eigen::Matrix<S, 6, 6> U = ws.U[static_cast<std::size_t>(c)];
      U.diagonal() += lambda * U.diagonal();
      U.diagonal().array() += std::numeric_limits<S>::min();
      ws.reduced.template block<6, 6>(6 * c, 6 * c) = U;
      ws.rhs.template segment<6>(6 * c) = -ws.b_pose[static_cast<std::size_t>(c)];
    }
    for (std::size_t first = 0; first < observations.size();) {
      const auto j = static_cast<std::size_t>(observations[first].point);
      std::size_t last = first;
      while (last < observations.size() && observations[last].point == observations[first].point) ++last;
      Matrix3 V = ws.V[j];
      V.diagonal() += lambda * V.diagonal();
      const S scale = V.trace();
      Matrix3 inverse = Matrix3::Zero();
      if (scale > S(0)) {
        // One sight without depth leaves the distance open: that direction is held.
        V.diagonal().array() += S(1e-9) * scale;
        inverse = V.inverse();
      }
      ws.V_inverse[j] = inverse;
      for (std::size_t a = first; a < last; ++a) {
        const int ca = ws.column[static_cast<std::size_t>(observations[a].pose)];
        if (ca < 0) continue;
        const Eigen::Matrix<S, 6, 3> Y = ws.W[a] * inverse;
        ws.rhs.template segment<6>(6 * ca).noalias() += Y * ws.b_point[j];
        for (std::size_t b = first; b < last; ++b) {
          const int cb = ws.column[static_cast<std::size_t>(observations[b].pose)];
          if (cb < 0 || cb > ca) continue;  // the lower triangle
          ws.reduced.template block<6, 6>(6 * ca, 6 * cb).noalias() -= Y * ws.W[b].transpose();
        }
      }
      first = last;
    }
    ws.factor.compute(ws.reduced);
    if (ws.factor.info() != Eigen::Success) return false;
    ws.step = ws.factor.solve(ws.rhs);
    return ws.step.allFinite();
  };

  const auto apply = [&] {
    std::copy(problem.poses.begin(), problem.poses.end(), ws.poses.begin());
    std::copy(problem.points.begin(), problem.points.end(), ws.points.begin());
    for (std::size_t first = 0; first < observations.size();) {
      const auto j = static_cast<std::size_t>(observations[first].point);
      Vector3 b = -ws.b_point[j];
      std::size_t k = first;
      for (; k < observations.size() && observations[k].point == observations[first].point; ++k) {
        const int c = ws.column[static_cast<std::size_t>(observations[k].pose)];
        if (c >= 0) b.noalias() -= ws.W[k].transpose() * ws.step.template segment<6>(6 * c);
      }
      problem.points[j] += ws.V_inverse[j] * b;
      first = k;
    }
    for (std::size_t i = 0; i < problem.poses.size(); ++i) {
      if (ws.column[i] < 0) continue;
      const Vector6 delta = ws.step.template segment<6>(6 * ws.column[i]);
      problem.poses[i] = SE3<S>::exp(delta) * problem.poses[i];
    }
  };

  S lambda = options.initial_damping;
  result.status = BundleStatus::max_iterations;
  bool fresh = true;
  while (result.iterations < options.max_iterations) {
    if (fresh) linearise();
    ++result.iterations;
    fresh = false;
    bool accepted = false;
    if (solve(lambda)) {
      apply();
      const Cost trial = cost_now();
      accepted = trial.known <= cost;
      if (accepted) {
        const S decrease = cost - trial.known;
        mark_in_front();
        cost = trial.all;
        fresh = true;
        lambda = std::max(lambda * S(0.1), S(1e-10));
        if (decrease <= options.tolerance * cost) {
          result.status = BundleStatus::converged;
          break;
        }
      } else {
        std::copy(ws.poses.begin(), ws.poses.end(), problem.poses.begin());
        std::copy(ws.points.begin(), ws.points.end(), problem.points.begin());
      }
    }
    if (!accepted) {
      lambda *= S(10);
      if (lambda > S(1e8)) {
        result.status = BundleStatus::stalled;
        break;
      }
    }
  }
  result.final_cost = cost;
  return result;
}

}  // namespace dynslam
