// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <concepts>
#include <cstddef>
#include <span>
#include <type_traits>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/concepts/robust.hpp"
#include "dynslam/config.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/optim/pose.hpp"

namespace dynslam {

/// What is known of how a camera turns while it reads its rows, beyond the turn that the observations were
/// brought to the middle row by.
template <Scalar S>
struct TurnPrior {
  Eigen::Matrix<S, 3, 1> mean = Eigen::Matrix<S, 3, 1>::Zero();  ///< from the first row to the last [rad]
  S sigma = S(0.007);  ///< its standard deviation [rad], above 0: 0.3 rad/s in a readout of 24 ms
};

namespace detail {

/// Rows that a camera reads while it turns by an unknown amount: the pose of a row that is `share` of the
/// readout after the middle one is (I + share hat(turn)) T_c_w.
template <std::floating_point S>
class TurningRows {
 public:
  static constexpr int kParameters = 9;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  using Turn = Vector3;
  struct Sums {
    PoseEquations<S> pose, mixed, turn;  // their weights times 1, share and share^2
  };

  TurningRows(std::span<const S> share, const TurnPrior<S>& prior)
      : share_(share), prior_(prior), information_(S(1) / (prior.sigma * prior.sigma)) {}

  [[nodiscard]] static Turn start() { return Turn::Zero(); }  // as the observations were placed
  [[nodiscard]] static const Vector3& of(const Turn& turn) { return turn; }
  [[nodiscard]] static Turn after(const Turn& turn, const Eigen::Matrix<S, 9, 1>& step) {
    return turn + step.template tail<3>();
  }
  [[nodiscard]] S prior_cost(const Turn& turn) const {
    return information_ * (turn - prior_.mean).squaredNorm();
  }
  [[nodiscard]] Vector3 in_row(const Turn& turn, std::size_t i, const Vector3& p) const {
    return p + share_[i] * turn.cross(p);
  }
  template <class Point, class Camera>
  void add(const Point& point, const Camera& camera, std::size_t i, S pixel_weight, S depth_weight,
           Sums& sums) const {
    const S share = share_[i], square = share * share;
    point.add_to(sums.pose, camera, pixel_weight, depth_weight);
    point.add_to(sums.mixed, camera, share * pixel_weight, share * depth_weight);
    point.add_to(sums.turn, camera, square * pixel_weight, square * depth_weight);
  }
  void store(const Sums& sums, const Turn& turn, NormalEquations<S, 9>& system) const {
    NormalEquations<S, 6> pose, mixed, own;
    sums.pose.store(pose);
    sums.mixed.store(mixed);
    sums.turn.store(own);
    Eigen::Matrix<S, 9, 9> H = Eigen::Matrix<S, 9, 9>::Zero();
    Eigen::Matrix<S, 9, 1> b;
    H.template topLeftCorner<6, 6>() = pose.hessian();
    H.template bottomLeftCorner<3, 6>() = mixed.hessian().template bottomRows<3>();
    H.template bottomRightCorner<3, 3>() = own.hessian().template bottomRightCorner<3, 3>();
    for (int i = 0; i < 6; ++i) b(i) = pose.gradient()(i);
    for (int i = 0; i < 3; ++i) {
      H(i + 6, i + 6) += information_;
      b(i + 6) = mixed.gradient()(i + 3) + information_ * (turn(i) - prior_.mean(i));
    }
    system.assign(H, b);
  }

 private:
  std::span<const S> share_;
  TurnPrior<S> prior_;
  S information_;
};

}  // namespace detail

/// optimize_pose() of a camera with a rolling shutter, whose turn while it reads its rows is estimated beside
/// the pose: 9 unknowns. The motion between two images tells that turn only on average, and a hand that
/// turns it does not turn evenly: half a degree per frame it changes by. Rows that stand a pixel beside where
/// they are believed to be, those above to one side and those below to the other, are taken for a shift
/// where what is seen below is nearer, as it is on every desk, and the pose jumps by millimetres from image
/// to image.
/// @param share  per observation: its row, counted from the middle one, as a share of all: -0.5 to 0.5. As
///               many as observations (asserted)
/// @param prior  what is known of the turn; where little is seen it decides
/// @return  `turn`: what RollingShutter::turned() takes; the covariance is the pose's, the turn left open
template <std::floating_point S, DifferentiableCameraOf<S> Camera, RobustKernel<S> Kernel>
PoseResult<S> optimize_rolling_pose(const Camera& camera,
                                    std::span<const PoseObservation<std::type_identity_t<S>>> observations,
                                    std::span<const std::type_identity_t<S>> share,
                                    const SE3<S>& T_c_w_initial,
                                    const TurnPrior<std::type_identity_t<S>>& prior,
                                    const PoseOptions<S>& options, const Kernel& kernel,
                                    PoseWorkspace<S>& workspace) {
  DYNSLAM_ASSERT(share.size() == observations.size(), "one share per observation");
  return detail::optimize_pose<S>(camera, observations, T_c_w_initial, options, kernel, workspace,
                                  detail::TurningRows<S>(share, prior));
}

/// The same for those who try it once: memory of its own, a t-distribution.
template <std::floating_point S, DifferentiableCameraOf<S> Camera>
[[nodiscard]] PoseResult<S> optimize_rolling_pose(
    const Camera& camera, std::span<const PoseObservation<std::type_identity_t<S>>> observations,
    std::span<const std::type_identity_t<S>> share, const SE3<S>& T_c_w_initial,
    const TurnPrior<std::type_identity_t<S>>& prior = {}, const PoseOptions<S>& options = {}) {
  PoseWorkspace<S> workspace;
  return optimize_rolling_pose(camera, observations, share, T_c_w_initial, prior, options, TDistribution<S>(),
                               workspace);
}

}  // namespace dynslam
