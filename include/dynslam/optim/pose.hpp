// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "dynslam/concepts/robust.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/optim/levenberg_marquardt.hpp"
#include "dynslam/optim/normal_equations.hpp"
#include "dynslam/optim/pose_equations.hpp"
#include "dynslam/optim/pose_residual.hpp"
#include "dynslam/robust/chi_square.hpp"
#include "dynslam/robust/rho_sum.hpp"
#include "dynslam/robust/t_distribution.hpp"

namespace dynslam {

/// Options of optimize_pose.
template <Scalar S>
struct PoseOptions {
  /// Optimisations, each followed by a new choice of inliers. From a consensus (absolute_pose()) two do: a
  /// third changes no pose. From a prediction it may.
  int rounds = 3;
  int max_iterations = 8;  ///< accepted or refused steps per round
  bool use_depth = true;
  S inlier_chi2_2d = S(kChiSquare95<2>);  ///< of an observation without depth
  S inlier_chi2_3d = S(kChiSquare95<3>);  ///< and with
  int min_observations = 6;
  S min_pixel_scale = S(1);  ///< below 1: pixel noise is estimated before each round as a factor of what the
                             ///< observations state, between this and 1, and used in its place
  /// Norm of the step that ends a round [m, rad]. In rounds that only choose inliers, too, it has to be
  /// small: between what stands and what moves the way is long and flat, and who stops on it takes the wrong
  /// ones.
  S tolerance = S(1e-6);
  S initial_damping = S(1e-4), min_damping = S(1e-9);  ///< lambda of Levenberg-Marquardt (see there)
};

/// How optimize_pose ended.
enum class PoseStatus : std::uint8_t {
  converged,
  max_iterations,        ///< the last round still moved when its iterations ended; the pose is usable
  too_few_observations,  ///< fewer observations or inliers than min_observations; pose = last good one
  degenerate,            ///< the observations do not determine the pose
  diverged               ///< non-finite input or no point in front of the camera
};

/// The pose that optimize_pose found, and how certain it is.
template <Scalar S>
struct PoseResult {
  SE3<S> T_c_w;
  Eigen::Matrix<S, 6, 6> covariance =
      Eigen::Matrix<S, 6, 6>::Zero();  ///< of the left increment; zero on failure
  int inliers = 0;                     ///< 0 on failure
  PoseStatus status = PoseStatus::too_few_observations;
  int iterations = 0;
  S cost = S(0);  ///< sum of rho over the inliers
  /// By how much more the camera turned from the first row to the last than the observations were placed
  /// for [rad]; zero where it was not asked (optimize_rolling_pose())
  Eigen::Matrix<S, 3, 1> turn = Eigen::Matrix<S, 3, 1>::Zero();
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

namespace detail {

/// All rows of an image have one pose, and nothing is unknown beside it.
template <std::floating_point S>
struct RowsAtOnce {
  static constexpr int kParameters = 6;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  struct Turn {};
  using Sums = PoseEquations<S>;

  [[nodiscard]] static Turn start() { return {}; }
  [[nodiscard]] static Vector3 of(Turn) { return Vector3::Zero(); }
  [[nodiscard]] static Turn after(Turn, const Eigen::Matrix<S, 6, 1>&) { return {}; }
  [[nodiscard]] static S prior_cost(Turn) { return S(0); }
  [[nodiscard]] static const Vector3& in_row(Turn, std::size_t, const Vector3& p) { return p; }
  template <class Point, class Camera>
  static void add(const Point& point, const Camera& camera, std::size_t, S pixel_weight, S depth_weight,
                  Sums& sums) {
    sums.add(point.terms(camera, pixel_weight, depth_weight));
  }
  static void store(const Sums& sums, Turn, NormalEquations<S, 6>& system) { sums.store(system); }
};

/// The pose of a camera as a LeastSquaresProblem, and the choice of its inliers.
/// @tparam Rows  RowsAtOnce, or what else is unknown of how the rows are read
template <std::floating_point S, class Camera, class Kernel, class Rows = RowsAtOnce<S>>
class PoseProblem {
 public:
  static constexpr int kParameters = Rows::kParameters;
  using System = NormalEquations<S, kParameters>;

  PoseProblem(const Camera& camera, std::span<const PoseObservation<S>> observations, const SE3<S>& T_c_w,
              const PoseOptions<S>& options, const Kernel& kernel, PoseWorkspace<S>& workspace,
              const Rows& rows = {})
      : camera_(camera),
        observations_(observations),
        options_(options),
        kernel_(kernel),
        ws_(workspace),
        rows_(rows),
        T_(T_c_w),
        turn_(rows_.start()),
        trial_turn_(turn_) {}

  [[nodiscard]] const SE3<S>& pose() const { return T_; }
  [[nodiscard]] Eigen::Matrix<S, 3, 1> turn() const { return rows_.of(turn_); }

  /// Linearises at the pose. @return the cost, not finite where there is nothing to minimise
  [[nodiscard]] S start_round() {
    if (options_.min_pixel_scale < S(1)) pixel_information_ = estimate_pixel_information();
    S cost = linearise_at(T_, turn_, system_);
    if (!std::isfinite(cost)) {  // inliers that the camera does not see from here cannot be inliers
      Eigen::Matrix<S, 3, 1> r;
      for (std::size_t i = 0; i < observations_.size(); ++i) {
        const PoseObservation<S>& o = observations_[i];
        if (!residual(i, r) || !std::isfinite(chi2(o, r, has_depth(o), pixel_information_)))
          ws_.inlier[i] = 0;
      }
      cost = linearise_at(T_, turn_, system_);
    }
    return cost;
  }

  /// Sorts the observations into inliers and outliers anew. @return the number of inliers
  [[nodiscard]] int classify(S& cost) {
    int inliers = 0;
    RhoSum<S, Kernel> sum(kernel_);
    Eigen::Matrix<S, 3, 1> r;
    for (std::size_t i = 0; i < observations_.size(); ++i) {
      const PoseObservation<S>& o = observations_[i];
      const bool depth = has_depth(o);
      const bool visible = residual(i, r);
      const S s = visible ? chi2(o, r, depth, pixel_information_) : std::numeric_limits<S>::infinity();
      ws_.inlier[i] = s < (depth ? options_.inlier_chi2_3d : options_.inlier_chi2_2d) ? 1 : 0;
      ws_.weight[i] = std::isfinite(s) ? kernel_.weight(s) : S(0);
      if (ws_.inlier[i] != 0) {
        ++inliers;
        sum.add(s);
      }
    }
    cost = sum.value();
    return inliers;
  }

  [[nodiscard]] bool covariance(Eigen::Matrix<S, 6, 6>& out) const {
    typename System::Matrix all;
    if (!system_.covariance(all)) return false;
    out = all.template topLeftCorner<6, 6>();
    return true;
  }

  // LeastSquaresProblem. Nearly every step is accepted, so apply() forms cost and system in one pass.
  void linearise() {}
  [[nodiscard]] bool solve(const S& lambda) { return system_.solve(lambda, step_); }
  [[nodiscard]] S apply() {
    trial_ = SE3<S>::exp(step_.template head<6>()) * T_;
    trial_turn_ = rows_.after(turn_, step_);
    return linearise_at(trial_, trial_turn_, trial_system_);
  }
  S accept(const S& trial_cost) {
    T_ = trial_;
    turn_ = trial_turn_;
    std::swap(system_, trial_system_);
    return trial_cost;
  }
  void restore() {}
  [[nodiscard]] bool converged(bool, const S&, const S&) const { return step_.norm() < options_.tolerance; }

 private:
  [[nodiscard]] bool has_depth(const PoseObservation<S>& o) const {
    return options_.use_depth && measures_depth(o);
  }
  [[nodiscard]] static S chi2(const PoseObservation<S>& o, const Eigen::Matrix<S, 3, 1>& r, bool depth,
                              S pixel_information) {
    const S pixel = pixel_information * o.inv_sigma_px2 * (r.x() * r.x() + r.y() * r.y());
    return depth ? pixel + o.inv_sigma_z2 * r.z() * r.z() : pixel;
  }

  [[nodiscard]] bool residual(std::size_t i, Eigen::Matrix<S, 3, 1>& r) const {
    const PoseObservation<S>& o = observations_[i];
    return point_residual(camera_, rows_.in_row(turn_, i, T_ * o.p_w), o, r);
  }

  /// Cost over the inliers and its linearisation. A point that the camera does not see makes the cost
  /// infinite, so that such a step is refused.
  [[nodiscard]] S linearise_at(const SE3<S>& T, const typename Rows::Turn& turn, System& system) const {
    const auto motion = T.isometry();
    const S pixel_information = pixel_information_;
    typename Rows::Sums sums;
    PointLinearisation<Camera> point;
    RhoSum<S, Kernel> cost(kernel_);
    for (std::size_t i = 0; i < observations_.size(); ++i) {
      if (ws_.inlier[i] == 0) continue;
      const PoseObservation<S>& o = observations_[i];
      if (!point.at(camera_, rows_.in_row(turn, i, motion * o.p_w), o))
        return std::numeric_limits<S>::infinity();
      const bool depth = has_depth(o);
      const S s = chi2(o, point.r, depth, pixel_information);
      cost.add(s);
      const S weight = kernel_.weight(s);
      rows_.add(point, camera_, i, weight * pixel_information * o.inv_sigma_px2,
                depth ? weight * o.inv_sigma_z2 : S(0), sums);
    }
    rows_.store(sums, turn, system);
    return rows_.prior_cost(turn) + cost.value();
  }

  /// Factor on the stated one: half of true matches lie below the median of chi-square.
  [[nodiscard]] S estimate_pixel_information() {
    ws_.scratch.clear();
    Eigen::Matrix<S, 3, 1> r;
    for (std::size_t i = 0; i < observations_.size(); ++i) {
      const PoseObservation<S>& o = observations_[i];
      if (ws_.inlier[i] == 0 || !residual(i, r)) continue;
      const S s = o.inv_sigma_px2 * (r.x() * r.x() + r.y() * r.y());
      if (std::isfinite(s)) ws_.scratch.push_back(s);  // no order with what is not a number
    }
    if (ws_.scratch.empty()) return S(1);
    const auto middle = ws_.scratch.begin() + static_cast<std::ptrdiff_t>(ws_.scratch.size() / 2);
    std::nth_element(ws_.scratch.begin(), middle, ws_.scratch.end());
    return S(1) / std::clamp(*middle / S(kChiSquareMedian2),
                             options_.min_pixel_scale * options_.min_pixel_scale, S(1));
  }

  const Camera& camera_;
  std::span<const PoseObservation<S>> observations_;
  const PoseOptions<S>& options_;
  const Kernel& kernel_;
  PoseWorkspace<S>& ws_;
  Rows rows_;
  SE3<S> T_, trial_;
  typename Rows::Turn turn_, trial_turn_;
  System system_, trial_system_;
  typename System::Vector step_ = System::Vector::Zero();
  S pixel_information_ = S(1);
};

/// optimize_pose() and what else there is of its kind.
template <std::floating_point S, class Camera, class Kernel, class Rows>
PoseResult<S> optimize_pose(const Camera& camera, std::span<const PoseObservation<S>> observations,
                            const SE3<S>& T_c_w_initial, const PoseOptions<S>& options, const Kernel& kernel,
                            PoseWorkspace<S>& workspace, const Rows& rows) {
  PoseResult<S> result;
  result.T_c_w = T_c_w_initial;
  workspace.inlier.assign(observations.size(), 1);
  workspace.weight.assign(observations.size(), S(0));
  const auto fail = [&](PoseStatus status) {
    std::fill(workspace.inlier.begin(), workspace.inlier.end(), std::uint8_t{0});
    std::fill(workspace.weight.begin(), workspace.weight.end(), S(0));
    result.status = status;
    result.inliers = 0;
    result.cost = S(0);
    result.covariance.setZero();
    result.turn.setZero();
    return result;
  };
  if (observations.size() < static_cast<std::size_t>(options.min_observations))
    return fail(PoseStatus::too_few_observations);

  auto damping = damping_of<S>(options);
  damping.max_damping = std::numeric_limits<S>::infinity();  // the few iterations of a round are the limit
  damping.stop_unsolvable = true;                            // the observations do not determine the pose
  PoseProblem<S, Camera, Kernel, Rows> problem(camera, observations, T_c_w_initial, options, kernel,
                                               workspace, rows);
  for (int round = 0; round < options.rounds; ++round) {
    const S cost = problem.start_round();
    if (!std::isfinite(cost)) return fail(PoseStatus::diverged);
    const auto minimum = levenberg_marquardt(problem, cost, damping);
    result.iterations += minimum.iterations;
    if (minimum.status == LevenbergMarquardtStatus::unsolvable) return fail(PoseStatus::degenerate);
    result.status = status_of<PoseStatus>(minimum.status);
    result.inliers = problem.classify(result.cost);
    if (result.inliers < options.min_observations) return fail(PoseStatus::too_few_observations);
    result.T_c_w = problem.pose();
    result.turn = problem.turn();
  }
  if (!problem.covariance(result.covariance)) return fail(PoseStatus::degenerate);
  return result;
}

}  // namespace detail

/// Pose from reprojection and depth with a robust kernel on their joint squared normalised residual,
/// by Levenberg-Marquardt. After each round the observations are sorted into inliers and outliers
/// anew by chi-square, so an outlier may come back. Allocates only while the workspace grows.
/// @param camera  any camera with a derivative; the observations are its pixels
/// @param kernel  one kernel serves both cases; a t-distribution keeps the numerator it was given
/// @return status, flags, weights and number of inliers agree: a pose that failed has no inliers
template <std::floating_point S, DifferentiableCameraOf<S> Camera, RobustKernel<S> Kernel>
PoseResult<S> optimize_pose(const Camera& camera,
                            std::span<const PoseObservation<std::type_identity_t<S>>> observations,
                            const SE3<S>& T_c_w_initial, const PoseOptions<S>& options, const Kernel& kernel,
                            PoseWorkspace<S>& workspace) {
  return detail::optimize_pose<S>(camera, observations, T_c_w_initial, options, kernel, workspace,
                                  detail::RowsAtOnce<S>());
}

/// The same for those who try it once: memory of its own, a t-distribution.
template <std::floating_point S, DifferentiableCameraOf<S> Camera>
[[nodiscard]] PoseResult<S> optimize_pose(
    const Camera& camera, std::span<const PoseObservation<std::type_identity_t<S>>> observations,
    const SE3<S>& T_c_w_initial, const PoseOptions<S>& options = {}) {
  PoseWorkspace<S> workspace;
  return optimize_pose(camera, observations, T_c_w_initial, options,
                       TDistribution<S>::with_dimension(S(5), 1), workspace);
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
