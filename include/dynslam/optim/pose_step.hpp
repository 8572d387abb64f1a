// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <concepts>
#include <optional>
#include <span>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/optim/normal_equations.hpp"
#include "dynslam/optim/pose_equations.hpp"
#include "dynslam/optim/pose_residual.hpp"

namespace dynslam::detail {

/// Gauss-Newton steps of a pose on observations below a limit, for consensus: no weights, no damping.
template <std::floating_point S, class Camera>
class PoseStep {
 public:
  using Motion = Eigen::Transform<S, 3, Eigen::Isometry>;

  void set_zero() { sums_.set_zero(); }
  /// Adds an observation whose squared normalised error is below the limit. @return whether it is
  bool add(const Camera& camera, const PoseObservation<S>& o, const Motion& motion, S limit) {
    if (!point_.at(camera, motion * o.p_w, o) || !(observation_chi2(o, point_.r) < limit)) return false;
    sums_.add(point_.terms(camera, o.inv_sigma_px2, measures_depth(o) ? o.inv_sigma_z2 : S(0)));
    return true;
  }
  /// The pose after a step of what was added; nullopt where that determines none.
  [[nodiscard]] std::optional<SE3<S>> from(const SE3<S>& T_c_w) {
    Eigen::Matrix<S, 6, 1> step;
    sums_.store(system_);
    if (!system_.solve(S(0), step)) return std::nullopt;
    return SE3<S>::exp(step) * T_c_w;
  }
  /// The pose after a step of all observations below the limit.
  [[nodiscard]] std::optional<SE3<S>> from(const Camera& camera, const SE3<S>& T_c_w,
                                           std::span<const PoseObservation<S>> observations, S limit) {
    set_zero();
    const Motion motion = T_c_w.isometry();
    for (const PoseObservation<S>& o : observations) (void)add(camera, o, motion, limit);
    return from(T_c_w);
  }

 private:
  NormalEquations<S, 6> system_;
  PoseEquations<S> sums_;
  PointLinearisation<Camera> point_;
};

}  // namespace dynslam::detail

#include "dynslam/pop_macros.hpp"
