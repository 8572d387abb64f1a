// SPDX-License-Identifier: BSD-3-Clause
// Rivals of optimize_pose: Ceres with one residual block per observation, and its TinySolver.
#pragma once

#include <ceres/ceres.h>
#include <ceres/rotation.h>
#include <ceres/tiny_solver.h>
#include <ceres/tiny_solver_autodiff_function.h>

#include <array>
#include <cmath>
#include <span>

#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/optim/pose_residual.hpp"

namespace dynslam::baselines {

/// Angle axis, then translation.
using CeresPose = std::array<double, 6>;

[[nodiscard]] inline CeresPose to_ceres(const SE3d& T) {
  const Eigen::Vector3d angle = T.so3().log();
  const Eigen::Vector3d& t = T.translation();
  return {angle.x(), angle.y(), angle.z(), t.x(), t.y(), t.z()};
}
[[nodiscard]] inline SE3d from_ceres(const CeresPose& p) {
  return SE3d(SO3d::exp(Eigen::Vector3d(p[0], p[1], p[2])), Eigen::Vector3d(p[3], p[4], p[5]));
}

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
template <class T>
void pose_residual(const Pinhole<double>& camera, const PoseObservation<double>& o, const T* pose,
                   const T* point, T* r) {
  T p[3];
  ceres::AngleAxisRotatePoint(pose, point, p);
  for (int i = 0; i < 3; ++i) p[i] += pose[3 + i];
  const double px = std::sqrt(o.inv_sigma_px2);
  r[0] = (camera.fx() * p[0] / p[2] + camera.cx() - o.x.x()) * px;
  r[1] = (camera.fy() * p[1] / p[2] + camera.cy() - o.x.y()) * px;
  r[2] = measures_depth(o) ? (p[2] - o.depth) * std::sqrt(o.inv_sigma_z2) : T(0);
}

struct PoseCost {
  Pinhole<double> camera;
  PoseObservation<double> o;
  template <class T>
  bool operator()(const T* pose, T* r) const {
    const T point[3] = {T(o.p_w.x()), T(o.p_w.y()), T(o.p_w.z())};
    pose_residual(camera, o, pose, point, r);
    return true;
  }
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
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<PoseCost, 3, 6>(new PoseCost{camera, o}),
                             robust ? &loss : nullptr, pose.data());
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  return from_ceres(pose);
}

/// All residuals as one function of the pose, for the TinySolver, which knows no loss.
struct TinyPose {
  using Scalar = double;
  enum { NUM_RESIDUALS = Eigen::Dynamic, NUM_PARAMETERS = 6 };
  Pinhole<double> camera;
  std::span<const PoseObservation<double>> observations;

  [[nodiscard]] int NumResiduals() const { return 3 * static_cast<int>(observations.size()); }
  bool operator()(const double* pose, double* residuals, double* jacobian) const {
    using Jet = ceres::Jet<double, 6>;
    const int rows = NumResiduals();
    Jet variable[6];
    for (int c = 0; c < 6; ++c) variable[c] = Jet(pose[c], c);
    int row = 0;
    for (const auto& o : observations) {
      if (jacobian == nullptr) {
        (void)PoseCost{camera, o}(pose, residuals + row);
      } else {
        Jet r[3];
        (void)PoseCost{camera, o}(variable, r);
        for (int k = 0; k < 3; ++k) {
          residuals[row + k] = r[k].a;
          for (int c = 0; c < 6; ++c) jacobian[c * rows + row + k] = r[k].v(c);
        }
      }
      row += 3;
    }
    return true;
  }
};

/// @param solver  kept between calls, with its memory
[[nodiscard]] inline SE3d tiny_pose(ceres::TinySolver<TinyPose>& solver, const Pinhole<double>& camera,
                                    std::span<const PoseObservation<double>> observations,
                                    const SE3d& initial) {
  const CeresPose start = to_ceres(initial);
  Eigen::Matrix<double, 6, 1> x = Eigen::Map<const Eigen::Matrix<double, 6, 1>>(start.data());
  solver.Solve(TinyPose{camera, observations}, &x);
  CeresPose pose;
  Eigen::Map<Eigen::Matrix<double, 6, 1>>(pose.data()) = x;
  return from_ceres(pose);
}

}  // namespace dynslam::baselines
