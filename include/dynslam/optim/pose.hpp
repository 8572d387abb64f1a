// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "dynslam/concepts/robust.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/optim/normal_equations.hpp"
#include "dynslam/robust/t_distribution.hpp"

namespace dynslam {

/// A known point seen at a pixel, with a measured depth where there is one.
template <Scalar S>
struct PoseObservation {
  Eigen::Matrix<S, 3, 1> p_w;  ///< world [m]
  Eigen::Matrix<S, 2, 1> x;    ///< ideal (undistorted) pixel
  S depth = S(0);              ///< along the optical axis [m]; invalid: reprojection only
  S inv_sigma_px2 = S(1);      ///< 1 / variance of each pixel coordinate [1/px^2]
  S inv_sigma_z2 = S(0);       ///< 1 / variance of the depth [1/m^2]
};

template <Scalar S>
struct PoseOptions {
  int rounds = 3;          ///< optimisations, each followed by a new choice of inliers
  int max_iterations = 8;  ///< accepted or refused steps per round
  bool use_depth = true;
  S inlier_chi2_2d = S(5.991);  ///< 95 % of chi-square with 2 degrees of freedom
  S inlier_chi2_3d = S(7.815);  ///< and with 3
  int min_observations = 6;
  S min_pixel_scale = S(1);  ///< below 1: pixel noise is estimated before each round as a factor of what the
                             ///< observations state, between this and 1, and used in its place
  S tolerance = S(1e-6);     ///< norm of the step that ends a round
};

enum class PoseStatus : std::uint8_t {
  converged,
  max_iterations,        ///< the last round still moved when its iterations ended; the pose is usable
  too_few_observations,  ///< fewer observations or inliers than min_observations; pose = last good one
  degenerate,            ///< the observations do not determine the pose
  diverged               ///< non-finite input or no point in front of the camera
};

template <Scalar S>
struct PoseResult {
  SE3<S> T_c_w;
  Eigen::Matrix<S, 6, 6> covariance =
      Eigen::Matrix<S, 6, 6>::Zero();  ///< of the left increment; zero on failure
  int inliers = 0;                     ///< 0 on failure
  PoseStatus status = PoseStatus::too_few_observations;
  int iterations = 0;
  S cost = S(0);  ///< sum of rho over the inliers
  [[nodiscard]] bool ok() const {
    return status == PoseStatus::converged || status == PoseStatus::max_iterations;
  }
};

/// Memory and per-observation output of optimize_pose; keep it between calls to avoid allocation.
template <Scalar S>
struct PoseWorkspace {
  std::vector<std::uint8_t> inlier;  ///< out: 1 = within the chi-square bound at the result; all 0 on failure
  std::vector<S> weight;             ///< out: robust weight at the result; all 0 on failure
  std::vector<S> scratch;
};

/// Residual [u - x_u, v - x_v, p_z - depth] of the camera-frame point p.
/// @param dx  where given, the derivative of the pixel by p
/// @return false when the point is not in front of the camera
template <Scalar S>
[[nodiscard]] bool point_residual(const Pinhole<S>& camera, const Eigen::Matrix<S, 3, 1>& p,
                                  const PoseObservation<S>& o, Eigen::Matrix<S, 3, 1>& r,
                                  typename Pinhole<S>::Jacobian* dx = nullptr) {
  const auto x = camera.project(p, dx);
  if (!x) return false;
  r << x->x() - o.x.x(), x->y() - o.x.y(), p.z() - o.depth;
  return true;
}

/// The same of a point of the world under a pose, and its derivative with respect to the left increment
/// [upsilon; omega] of T_c_w (rows 0-1: Eq 5, row 2: Eq 6).
/// @param T_c_w  SE3, or its isometry() where many points follow
/// @return false when the point is not in front of the camera
template <Scalar S, class Transform>
[[nodiscard]] bool pose_residual(const Pinhole<S>& camera, const Transform& T_c_w,
                                 const PoseObservation<S>& o, Eigen::Matrix<S, 3, 1>& r,
                                 Eigen::Matrix<S, 3, 6>* J) {
  const Eigen::Matrix<S, 3, 1> p = T_c_w * o.p_w;
  typename Pinhole<S>::Jacobian dx;
  if (!point_residual(camera, p, o, r, J != nullptr ? &dx : nullptr)) return false;
  if (J != nullptr) {  // d p / d delta = [I, -hat(p)]
    Eigen::Matrix<S, 3, 6> dp;
    dp << S(1), S(0), S(0), S(0), p.z(), -p.y(), S(0), S(1), S(0), -p.z(), S(0), p.x(), S(0), S(0), S(1),
        p.y(), -p.x(), S(0);
    J->template topRows<2>().noalias() = dx * dp;
    J->row(2) = dp.row(2);
  }
  return true;
}

/// Whether the depth of an observation is known, and how well.
template <Scalar S>
[[nodiscard]] bool measures_depth(const PoseObservation<S>& o) {
  return o.inv_sigma_z2 > S(0) && is_valid_depth(o.depth);
}

/// Squared normalised error of an observation with the given residual (pose_residual).
template <Scalar S>
[[nodiscard]] S observation_chi2(const PoseObservation<S>& o, const Eigen::Matrix<S, 3, 1>& r) {
  const S pixel = o.inv_sigma_px2 * (r.x() * r.x() + r.y() * r.y());
  return measures_depth(o) ? pixel + o.inv_sigma_z2 * r.z() * r.z() : pixel;
}

/// Squared normalised error of an observation under a pose; infinity behind the camera.
template <std::floating_point S, class Transform>
[[nodiscard]] S observation_chi2(const Pinhole<S>& camera, const Transform& T_c_w,
                                 const PoseObservation<S>& o) {
  Eigen::Matrix<S, 3, 1> r;
  return pose_residual<S>(camera, T_c_w, o, r, nullptr) ? observation_chi2(o, r)
                                                        : std::numeric_limits<S>::infinity();
}

/// Sums the normal equations of a pose over its observations.
///
/// Row by row (NormalEquations::add_row) most products are with zeros or are repeated: the Jacobian is
/// P [I, -hat(p)] with the derivative P of (u, v, z) by the camera-frame point p, so that J^T W J has the
/// blocks A = P^T W P, B = -A hat(p) and C = hat(p) B.
template <Scalar S>
class PoseEquations {
 public:
  using Vector3 = Eigen::Matrix<S, 3, 1>;

  void set_zero() { *this = PoseEquations(); }

  /// @param p  camera-frame point, in front of the camera
  /// @param r  its residual (point_residual)
  /// @param pixel_weight, depth_weight  of the squares of r's first two components and of the third
  void add(const Pinhole<S>& camera, const Vector3& p, const Vector3& r, const S& pixel_weight,
           const S& depth_weight) {
    const S inverse = S(1) / p.z();
    const S a = camera.fx() * inverse, b = camera.fy() * inverse;  // P = [a 0 c; 0 b d; 0 0 1]
    const S c = -a * p.x() * inverse, d = -b * p.y() * inverse;
    const S wa = pixel_weight * a, wb = pixel_weight * b, wc = pixel_weight * c, wd = pixel_weight * d;
    const S a00 = wa * a, a11 = wb * b, a02 = wa * c, a12 = wb * d, a22 = wc * c + wd * d + depth_weight;
    a_[0] += a00;
    a_[1] += a11;
    a_[2] += a02;
    a_[3] += a12;
    a_[4] += a22;
    const S x = p.x(), y = p.y(), z = p.z();
    Eigen::Matrix<S, 3, 3> B;
    B << a02 * y, a00 * z - a02 * x, -a00 * y,  //
        a12 * y - a11 * z, -a12 * x, a11 * x,   //
        a22 * y - a12 * z, a02 * z - a22 * x, a12 * x - a02 * y;
    B_ += B;
    c_[0] += y * B(2, 0) - z * B(1, 0);
    c_[1] += z * B(0, 0) - x * B(2, 0);
    c_[2] += z * B(0, 1) - x * B(2, 1);
    c_[3] += x * B(1, 0) - y * B(0, 0);
    c_[4] += x * B(1, 1) - y * B(0, 1);
    c_[5] += x * B(1, 2) - y * B(0, 2);
    const Vector3 force(wa * r.x(), wb * r.y(), wc * r.x() + wd * r.y() + depth_weight * r.z());
    force_ += force;
    torque_ +=
        Vector3(y * force.z() - z * force.y(), z * force.x() - x * force.z(), x * force.y() - y * force.x());
  }

  void store(NormalEquations<S, 6>& system) const {
    Eigen::Matrix<S, 6, 6> H = Eigen::Matrix<S, 6, 6>::Zero();
    H(0, 0) = a_[0];
    H(1, 1) = a_[1];
    H(2, 0) = a_[2];
    H(2, 1) = a_[3];
    H(2, 2) = a_[4];
    H.template bottomLeftCorner<3, 3>() = B_.transpose();
    H(3, 3) = c_[0];
    H(4, 3) = c_[1];
    H(4, 4) = c_[2];
    H(5, 3) = c_[3];
    H(5, 4) = c_[4];
    H(5, 5) = c_[5];
    Eigen::Matrix<S, 6, 1> b;
    b << force_, torque_;
    system.assign(H, b);
  }

 private:
  std::array<S, 5> a_{};  // A: 00, 11, 02, 12, 22; 01 is zero
  Eigen::Matrix<S, 3, 3> B_ = Eigen::Matrix<S, 3, 3>::Zero();
  std::array<S, 6> c_{};  // C: 00, 10, 11, 20, 21, 22
  Vector3 force_ = Vector3::Zero(), torque_ = Vector3::Zero();
};

/// Pose from reprojection and depth with a robust kernel on their joint squared normalised residual,
/// by Levenberg-Marquardt. After each round the observations are sorted into inliers and outliers
/// anew by chi-square, so an outlier may come back. Allocates only while the workspace grows.
/// @param kernel  one kernel serves both cases; a t-distribution keeps the numerator it was given
template <std::floating_point S, RobustKernel<S> Kernel>
PoseResult<S> optimize_pose(const Pinhole<S>& camera, std::span<const PoseObservation<S>> observations,
                            const SE3<S>& T_c_w_initial, const PoseOptions<S>& options, const Kernel& kernel,
                            PoseWorkspace<S>& workspace) {
  PoseResult<S> result;
  result.T_c_w = T_c_w_initial;
  const std::size_t n = observations.size();
  workspace.inlier.assign(n, 1);
  workspace.weight.assign(n, S(0));
  // A pose that failed has no inliers, whatever was counted on the way.
  const auto fail = [&](PoseStatus status) {
    std::fill(workspace.inlier.begin(), workspace.inlier.end(), std::uint8_t{0});
    std::fill(workspace.weight.begin(), workspace.weight.end(), S(0));
    result.status = status;
    result.inliers = 0;
    result.cost = S(0);
    return result;
  };
  if (n < static_cast<std::size_t>(options.min_observations)) return fail(PoseStatus::too_few_observations);

  S pixel_information = S(1);  // factor on the stated one
  const auto chi2 = [&](const PoseObservation<S>& o, const Eigen::Matrix<S, 3, 1>& r, bool depth) {
    const S pixel = pixel_information * o.inv_sigma_px2 * (r.x() * r.x() + r.y() * r.y());
    return depth ? pixel + o.inv_sigma_z2 * r.z() * r.z() : pixel;
  };
  const auto has_depth = [&](const PoseObservation<S>& o) { return options.use_depth && measures_depth(o); };
  // Cost over the inliers and its linearisation in one pass: nearly every step is accepted, so the next one
  // needs both. Points behind the camera make the cost infinite, so that such a step is refused.
  PoseEquations<S> sums;
  const auto linearise = [&](const SE3<S>& T, NormalEquations<S, 6>& system) {
    const auto motion = T.isometry();
    sums.set_zero();
    S cost = S(0);
    Eigen::Matrix<S, 3, 1> r;
    for (std::size_t i = 0; i < n; ++i) {
      if (workspace.inlier[i] == 0) continue;
      const PoseObservation<S>& o = observations[i];
      const Eigen::Matrix<S, 3, 1> p = motion * o.p_w;
      if (!point_residual(camera, p, o, r)) return std::numeric_limits<S>::infinity();
      const bool depth = has_depth(o);
      const S s = chi2(o, r, depth);
      cost += kernel.rho(s);
      const S weight = kernel.weight(s);
      sums.add(camera, p, r, weight * pixel_information * o.inv_sigma_px2,
               depth ? weight * o.inv_sigma_z2 : S(0));
    }
    sums.store(system);
    return cost;
  };

  // Half of true matches lie below the median of chi-square with 2 degrees of freedom.
  const auto estimate_pixel_information = [&](const SE3<S>& T) {
    workspace.scratch.clear();
    Eigen::Matrix<S, 3, 1> r;
    for (std::size_t i = 0; i < n; ++i) {
      const PoseObservation<S>& o = observations[i];
      if (workspace.inlier[i] == 0 || !pose_residual<S>(camera, T, o, r, nullptr)) continue;
      workspace.scratch.push_back(o.inv_sigma_px2 * (r.x() * r.x() + r.y() * r.y()));
    }
    if (workspace.scratch.empty()) return S(1);
    const auto middle = workspace.scratch.begin() + static_cast<std::ptrdiff_t>(workspace.scratch.size() / 2);
    std::nth_element(workspace.scratch.begin(), middle, workspace.scratch.end());
    constexpr double kMedian = 1.3863;
    return S(1) / std::clamp(*middle / S(kMedian), options.min_pixel_scale * options.min_pixel_scale, S(1));
  };

  NormalEquations<S, 6> system, trial_system;
  SE3<S> T = T_c_w_initial;
  for (int round = 0; round < options.rounds; ++round) {
    if (options.min_pixel_scale < S(1)) pixel_information = estimate_pixel_information(T);
    S lambda = S(1e-4), cost = linearise(T, system);
    if (!std::isfinite(cost)) {  // the start puts inliers behind the camera: those cannot be inliers
      Eigen::Matrix<S, 3, 1> r;
      for (std::size_t i = 0; i < n; ++i) {
        if (!pose_residual<S>(camera, T, observations[i], r, nullptr) || !r.allFinite())
          workspace.inlier[i] = 0;
      }
      cost = linearise(T, system);
      if (!std::isfinite(cost)) {
        return fail(PoseStatus::diverged);
      }
    }
    bool converged = false;
    for (int iteration = 0; iteration < options.max_iterations && !converged; ++iteration) {
      ++result.iterations;
      Eigen::Matrix<S, 6, 1> step;
      if (!system.solve(lambda, step)) return fail(PoseStatus::degenerate);
      const SE3<S> trial = SE3<S>::exp(step) * T;
      const S trial_cost = linearise(trial, trial_system);
      if (trial_cost <= cost) {
        T = trial;
        cost = trial_cost;
        std::swap(system, trial_system);
        lambda = std::max(lambda * S(0.1), S(1e-9));
      } else {
        lambda *= S(10);
      }
      converged = step.norm() < options.tolerance;
    }
    result.status = converged ? PoseStatus::converged : PoseStatus::max_iterations;

    int inliers = 0;
    result.cost = S(0);
    Eigen::Matrix<S, 3, 1> r;
    for (std::size_t i = 0; i < n; ++i) {
      const PoseObservation<S>& o = observations[i];
      const bool depth = has_depth(o);
      const bool visible = pose_residual<S>(camera, T, o, r, nullptr);
      const S s = visible ? chi2(o, r, depth) : std::numeric_limits<S>::infinity();
      workspace.inlier[i] = s < (depth ? options.inlier_chi2_3d : options.inlier_chi2_2d) ? 1 : 0;
      workspace.weight[i] = visible ? kernel.weight(s) : S(0);
      if (workspace.inlier[i] != 0) {
        ++inliers;
        result.cost += kernel.rho(s);
      }
    }
    result.inliers = inliers;
    if (inliers < options.min_observations) return fail(PoseStatus::too_few_observations);
    result.T_c_w = T;
  }
  if (!system.covariance(result.covariance)) {
    result.covariance.setZero();
    return fail(PoseStatus::degenerate);
  }
  return result;
}

}  // namespace dynslam
