// SPDX-License-Identifier: BSD-3-Clause
// Rivals of optimize_pose: Ceres with one residual block per observation, and its TinySolver; Jacobians in
// closed form.
#pragma once

#include <ceres/ceres.h>
#include <ceres/tiny_solver.h>

#include <Eigen/LU>
#include <cmath>
#include <span>

#include "baselines/se3_ceres.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/optim/pose_residual.hpp"

namespace dynslam::baselines {

/// The loss of a t-distribution: rho(s) = numerator log(1 + s / nu). Ceres minimises half of the sum of rho.
struct TLoss : ceres::LossFunction {
  double nu = 5, numerator = 6;
  void Evaluate(double s, double out[3]) const override {
    out[0] = numerator * std::log1p(s / nu);
    out[1] = numerator / (nu + s);
    out[2] = -numerator / ((nu + s) * (nu + s));
  }
};

/// Pixel and depth; without depth the third component is zero.
/// @param p          the point before the camera
/// @param by_point  derivative by it; may be null
inline void pose_residual(const Pinhole<double>& camera, const PoseObservation<double>& o,
                          const Eigen::Vector3d& p, Eigen::Vector3d& r, Eigen::Matrix3d* by_point) {
  const double px = std::sqrt(o.inv_sigma_px2), iz = 1 / p.z();
  const double sz = measures_depth(o) ? std::sqrt(o.inv_sigma_z2) : 0.0;
  r << (camera.fx() * p.x() * iz + camera.cx() - o.x.x()) * px,
      (camera.fy() * p.y() * iz + camera.cy() - o.x.y()) * px, sz > 0 ? (p.z() - o.depth) * sz : 0.0;
  if (by_point == nullptr) return;
  const double fx = camera.fx() * px * iz, fy = camera.fy() * px * iz;
  *by_point << fx, 0, -fx * p.x() * iz, 0, fy, -fy * p.y() * iz, 0, 0, sz;
}
/// Derivative by the six numbers from the left, in the first six columns of seven.
inline void put_pose_jacobian(const Eigen::Matrix3d& by_point, const Eigen::Vector3d& p, double* jacobian) {
  Eigen::Map<Eigen::Matrix<double, 3, 7, Eigen::RowMajor>> to(jacobian);
  to.leftCols<3>() = by_point;
  to.middleCols<3>(3).noalias() = -by_point * SO3d::hat(p);
  to.col(6).setZero();
}

class PoseCost : public ceres::SizedCostFunction<3, 7> {
 public:
  PoseCost(const Pinhole<double>& camera, const PoseObservation<double>& o) : camera_(camera), o_(o) {}
  bool Evaluate(const double* const* poses, double* residuals, double** jacobians) const override {
    const Eigen::Vector3d p = from_ceres(poses[0]) * o_.p_w;
    const bool derive = jacobians != nullptr && jacobians[0] != nullptr;
    Eigen::Vector3d r;
    Eigen::Matrix3d by_point;
    pose_residual(camera_, o_, p, r, derive ? &by_point : nullptr);
    Eigen::Map<Eigen::Vector3d>(residuals, 3) = r;
    if (derive) put_pose_jacobian(by_point, p, jacobians[0]);
    return true;
  }

 private:
  Pinhole<double> camera_;
  PoseObservation<double> o_;
};

/// @param robust  with the t-distribution's loss; otherwise least squares
[[nodiscard]] inline SE3d ceres_pose(const Pinhole<double>& camera,
                                     std::span<const PoseObservation<double>> observations,
                                     const SE3d& initial, bool robust) {
  CeresPose pose = to_ceres(initial);
  ceres::Problem::Options shared;  // one loss for all
  shared.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  TLoss loss;
  ceres::Problem problem(shared);
  for (const auto& o : observations) {
    problem.AddResidualBlock(new PoseCost(camera, o), robust ? &loss : nullptr, pose.data());
  }
  problem.SetManifold(pose.data(), new LeftPoses);
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  return from_ceres(pose.data());
}

/// All residuals as one function of the pose's exp(x) from the start, for the TinySolver, which knows neither
/// manifolds nor losses.
struct TinyPose {
  using Scalar = double;
  enum { NUM_RESIDUALS = Eigen::Dynamic, NUM_PARAMETERS = 6 };
  Pinhole<double> camera;
  std::span<const PoseObservation<double>> observations;
  SE3d start;

  [[nodiscard]] int NumResiduals() const { return 3 * static_cast<int>(observations.size()); }
  bool operator()(const double* x, double* residuals, double* jacobian) const {
    const Eigen::Map<const Eigen::Matrix<double, 6, 1>> xi(x);
    const SE3d T = SE3d::exp(xi) * start;
    const int rows = NumResiduals();
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 6>> to(jacobian, jacobian == nullptr ? 0 : rows, 6);
    Eigen::Matrix<double, 6, 6> left;  // J of exp(x + d) = exp(J d) exp(x)
    if (jacobian != nullptr) left = SE3d::left_jacobian_inverse(xi).inverse();
    Eigen::Matrix<double, 3, 7, Eigen::RowMajor> row;
    int at = 0;
    for (const auto& o : observations) {
      const Eigen::Vector3d p = T * o.p_w;
      Eigen::Vector3d r;
      Eigen::Matrix3d by_point;
      pose_residual(camera, o, p, r, jacobian == nullptr ? nullptr : &by_point);
      Eigen::Map<Eigen::Vector3d>(residuals + at, 3) = r;
      if (jacobian != nullptr) {
        put_pose_jacobian(by_point, p, row.data());
        to.middleRows<3>(at).noalias() = row.leftCols<6>() * left;
      }
      at += 3;
    }
    return true;
  }
};

/// @param solver  kept between calls, with its memory
[[nodiscard]] inline SE3d tiny_pose(ceres::TinySolver<TinyPose>& solver, const Pinhole<double>& camera,
                                    std::span<const PoseObservation<double>> observations,
                                    const SE3d& initial) {
  Eigen::Matrix<double, 6, 1> x = Eigen::Matrix<double, 6, 1>::Zero();
  solver.Solve(TinyPose{camera, observations, initial}, &x);
  return SE3d::exp(x) * initial;
}

}  // namespace dynslam::baselines
