// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <array>
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
  using Terms = PoseTerms<S>;
  /// The equations of the pose; of its turn with the turn of the rows, whose derivative is `share` times the
  /// pose's; and of the latter alone.
  struct Sums {
    PoseEquations<S> pose;
    std::array<S, Terms::kCount - Terms::kB> mixed{};
    std::array<S, Terms::kTorque - Terms::kC> turn{};
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
    const Terms terms = point.terms(camera, pixel_weight, depth_weight);
    const S share = share_[i], square = share * share;
    sums.pose.add(terms);
    for (std::size_t k = 0; k < sums.mixed.size(); ++k) sums.mixed[k] += share * terms.value[Terms::kB + k];
    for (std::size_t k = 0; k < sums.turn.size(); ++k) sums.turn[k] += square * terms.value[Terms::kC + k];
  }
  void store(const Sums& sums, const Turn& turn, NormalEquations<S, 9>& system) const {
    Eigen::Matrix<S, 9, 9> H = Eigen::Matrix<S, 9, 9>::Zero();
    Eigen::Matrix<S, 9, 1> b;
    sums.pose.store(H, b);
    constexpr std::size_t kC = Terms::kC - Terms::kB, kTorque = Terms::kTorque - Terms::kB;
    std::size_t k = 0;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j <= i; ++j, ++k) {
        H(i + 6, j + 3) = H(j + 6, i + 3) = sums.mixed[kC + k];
        H(i + 6, j + 6) = sums.turn[k];
      }
      for (int j = 0; j < 3; ++j) H(i + 6, j) = sums.mixed[static_cast<std::size_t>(3 * j + i)];
      H(i + 6, i + 6) += information_;
      b(i + 6) =
          sums.mixed[kTorque + static_cast<std::size_t>(i)] + information_ * (turn(i) - prior_.mean(i));
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
  return optimize_rolling_pose(camera, observations, share, T_c_w_initial, prior, options,
                               TDistribution<S>::with_dimension(S(5), 1), workspace);
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
