// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "dynslam/geometry/se3.hpp"
#include "dynslam/optim/banded_system.hpp"
#include "dynslam/optim/small_cholesky.hpp"
#include "dynslam/robust/chi_square.hpp"

namespace dynslam {

/// Options of smooth_trajectory.
struct SmoothingOptions {
  double nu = 5;             ///< degrees of freedom of the t-distribution of the poses' errors
  int iterations = 4;        ///< of the weights by that
  double longest_gap = 0.3;  ///< time without a pose over which nothing is known of the motion [s]
  int min_poses = 12;        ///< in a row: of fewer the noise cannot be told
  /// Between the largest and the smallest weight of two poses: covariances of matches know no common error.
  double max_ratio = 100;
};

/// A pose of a trajectory that is to be smoothed.
template <std::floating_point S>
struct TrackedPose {
  double t = 0;  ///< [s]
  SE3<S> T_c_w;
  /// Of the left increment of T_c_w, up to a factor that all share; zero: unknown, and as good as the others.
  Eigen::Matrix<S, 6, 6> covariance = Eigen::Matrix<S, 6, 6>::Zero();
  bool begins = false;  ///< the camera was found anew: it did not move here from the pose before
};

/// How smooth_trajectory ended.
enum class SmoothingStatus : std::uint8_t {
  smoothed,
  too_few_poses,  ///< nowhere min_poses in a row; nothing was changed
  not_increasing  ///< times do not increase, or are not numbers; nothing was changed
};

/// What smooth_trajectory found.
struct SmoothingResult {
  SmoothingStatus status = SmoothingStatus::too_few_poses;
  double stiffness = 0;   ///< weight of the motion's third differences against a usual pose's error
  double noise = 0;       ///< by how far a pose lies beside what its neighbours say, RMS [m]
  double correction = 0;  ///< by how far the centres were moved, RMS [m]
  [[nodiscard]] bool ok() const { return status == SmoothingStatus::smoothed; }
};

/// Memory of smooth_trajectory; keep it between calls to avoid allocation.
struct SmoothingWorkspace {
  using Band = BandedSystem<double, 3>;
  std::vector<double> weight, robust, leverage, squared, sorted;
  std::array<std::vector<double>, 3> centre, smooth, best;  ///< x, y, z
  std::vector<std::array<double, 4>> difference;            ///< third ones, of poses i to i + 3; 0: a gap
  Band system;
};

namespace detail {

template <std::floating_point S>
class TrajectorySmoother {
 public:
  TrajectorySmoother(std::span<TrackedPose<S>> poses, const SmoothingOptions& options, SmoothingWorkspace& ws)
      : poses_(poses), options_(options), ws_(ws) {}

  SmoothingResult run() {
    SmoothingResult result;
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      if (std::isfinite(poses_[i].t) && (i == 0 || poses_[i].t > poses_[i - 1].t)) continue;
      result.status = SmoothingStatus::not_increasing;
      return result;
    }
    if (!find_differences()) return result;
    find_weights();
    double best = std::numeric_limits<double>::infinity();
    for (double stiffness = kSoftest; stiffness < kStiffest; stiffness *= kStep) {
      const double error = fit(stiffness);
      if (!(error < best)) continue;
      best = error;
      result.stiffness = stiffness;
      ws_.best = ws_.smooth;
    }
    if (!std::isfinite(best)) return result;
    result.status = SmoothingStatus::smoothed;
    result.noise = std::sqrt(best);
    result.correction = apply();
    return result;
  }

 private:
  // From a motion that says nothing to one whose poses say nothing.
  static constexpr double kSoftest = 1e-4, kStiffest = 1e6, kStep = 3.1622776601683795;
  static constexpr std::size_t kAround = 7;  // poses to either side that tell what is usual

  [[nodiscard]] bool joined(std::size_t i) const {  // with the pose before
    return !poses_[i].begins && poses_[i].t - poses_[i - 1].t <= options_.longest_gap;
  }

  /// Third differences of four poses in a row, those of an even motion at the usual interval being
  /// (-1, 3, -3, 1). @return whether there are any
  [[nodiscard]] bool find_differences() {
    const std::size_t n = poses_.size();
    ws_.difference.assign(n, {});
    ws_.sorted.clear();
    for (std::size_t i = 1; i < n; ++i) {
      if (joined(i)) ws_.sorted.push_back(poses_[i].t - poses_[i - 1].t);
    }
    if (ws_.sorted.empty()) return false;
    const double usual = median();
    bool any = false;
    for (std::size_t begin = 0, end = 1; begin < n; begin = end++) {
      while (end < n && joined(end)) ++end;
      if (end - begin < static_cast<std::size_t>(std::max(4, options_.min_poses))) continue;
      any = true;
      for (std::size_t i = begin; i + 3 < end; ++i) {
        for (std::size_t j = 0; j < 4; ++j) {
          double product = 6;
          for (std::size_t m = 0; m < 4; ++m) {
            if (m != j) product *= usual / (poses_[i + j].t - poses_[i + m].t);
          }
          ws_.difference[i][j] = product;
        }
      }
    }
    return any;
  }

  [[nodiscard]] double median() {
    const auto middle = ws_.sorted.begin() + static_cast<std::ptrdiff_t>(ws_.sorted.size() / 2);
    std::nth_element(ws_.sorted.begin(), middle, ws_.sorted.end());
    return *middle;
  }

  /// Of the centres, by the covariance of the translation; a usual pose has 1.
  void find_weights() {
    const auto variance = [](const TrackedPose<S>& pose) {
      const auto& c = pose.covariance;
      return static_cast<double>(c(0, 0)) + static_cast<double>(c(1, 1)) + static_cast<double>(c(2, 2));
    };
    ws_.sorted.clear();
    for (const TrackedPose<S>& pose : poses_) {
      if (variance(pose) > 0) ws_.sorted.push_back(variance(pose));
    }
    const double usual = ws_.sorted.empty() ? 1 : median(), most = std::sqrt(options_.max_ratio);
    ws_.weight.clear();
    for (std::vector<double>& axis : ws_.centre) axis.clear();
    for (const TrackedPose<S>& pose : poses_) {
      const double v = variance(pose);
      ws_.weight.push_back(v > 0 ? std::clamp(usual / v, 1 / most, most) : 1.0);
      const auto centre = pose.T_c_w.inverse().translation();
      for (std::size_t a = 0; a < 3; ++a)
        ws_.centre[a].push_back(static_cast<double>(centre(static_cast<Eigen::Index>(a))));
    }
  }

  /// Smooths with a stiffness. @return how far poses lie from what all the others say of them: squared,
  /// weighted, in the mean [m^2], what is far off alone counting less; infinite where nothing can be solved
  [[nodiscard]] double fit(double stiffness) {
    const std::size_t n = poses_.size();
    ws_.robust = ws_.weight;
    ws_.leverage.resize(n);
    ws_.squared.resize(n);
    double error = std::numeric_limits<double>::infinity();
    for (int iteration = 0; iteration < std::max(1, options_.iterations); ++iteration) {
      if (!solve(stiffness)) return std::numeric_limits<double>::infinity();
      leave_one_out();
      double sum = 0;
      for (std::size_t i = 0; i < n; ++i) {
        const double sigma2 = usual_around(i) / kChiSquareMedian3;
        const double doubt = sigma2 > 0 ? (options_.nu + 3) / (options_.nu + ws_.squared[i] / sigma2) : 1;
        ws_.robust[i] = ws_.weight[i] * doubt;
        sum += ws_.squared[i] * std::min(1.0, doubt);
      }
      error = sum / static_cast<double>(n);
    }
    return error;
  }

  /// Squared distances of the poses to what all the others say of them, weighted: the residual through what
  /// is left of a pose's own say.
  void leave_one_out() {
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      const double own = 1 - ws_.leverage[i] * ws_.robust[i];
      double squared = 0;
      for (std::size_t a = 0; a < 3; ++a) {
        const double r = ws_.centre[a][i] - ws_.smooth[a][i];
        squared += r * r;
      }
      ws_.squared[i] = own > 1e-9 ? ws_.weight[i] * squared / (own * own) : 0;
    }
  }

  /// Median of them around a pose: one that is far off stands alone, a fast motion does not.
  [[nodiscard]] double usual_around(std::size_t i) {
    const std::size_t begin = i < kAround ? 0 : i - kAround, end = std::min(poses_.size(), i + kAround + 1);
    ws_.sorted.assign(ws_.squared.begin() + static_cast<std::ptrdiff_t>(begin),
                      ws_.squared.begin() + static_cast<std::ptrdiff_t>(end));
    return median();
  }

  [[nodiscard]] bool solve(double stiffness) {
    const std::size_t n = poses_.size();
    auto& system = ws_.system;
    system.reset(n);
    for (std::size_t i = 0; i < n; ++i) system.at(i, 0) = ws_.robust[i];
    for (std::size_t i = 0; i + 3 < n; ++i) {
      for (std::size_t j = 0; j < 4; ++j) {
        for (std::size_t k = j; k < 4; ++k)
          system.at(i + j, k - j) += stiffness * ws_.difference[i][j] * ws_.difference[i][k];
      }
    }
    if (!system.factor()) return false;
    for (std::size_t a = 0; a < 3; ++a) {
      // Of the deviation from the first pose: coordinates far from the origin lose no digits.
      std::vector<double>& x = ws_.smooth[a];
      x.resize(n);
      const double origin = ws_.centre[a][0];
      for (std::size_t i = 0; i < n; ++i) x[i] = ws_.robust[i] * (ws_.centre[a][i] - origin);
      system.solve(x);
      for (double& value : x) value += origin;
    }
    system.inverse_diagonal(ws_.leverage);
    return true;
  }

  /// Moves the centres to the best ones and turns the poses as their covariances say that a pose which is off
  /// by so much is turned. @return RMS of the movement [m]
  double apply() {
    double sum = 0;
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      TrackedPose<S>& pose = poses_[i];
      Eigen::Matrix<S, 3, 1> centre, moved;
      for (std::size_t a = 0; a < 3; ++a) {
        const auto at = static_cast<Eigen::Index>(a);
        centre(at) = static_cast<S>(ws_.best[a][i]);
        moved(at) = static_cast<S>(ws_.best[a][i] - ws_.centre[a][i]);
      }
      sum += static_cast<double>(moved.squaredNorm());
      if (moved.isZero(S(0))) continue;
      const Eigen::Matrix<S, 3, 1> upsilon = -(pose.T_c_w.so3() * moved);
      const SO3<S> R = SO3<S>::exp(turn_of(pose.covariance, upsilon)) * pose.T_c_w.so3();
      pose.T_c_w = SE3<S>(R, -(R * centre));
    }
    return std::sqrt(sum / static_cast<double>(std::max<std::size_t>(1, poses_.size())));
  }

  /// C_omega,upsilon C_upsilon,upsilon^-1 upsilon
  [[nodiscard]] static Eigen::Matrix<S, 3, 1> turn_of(const Eigen::Matrix<S, 6, 6>& covariance,
                                                      const Eigen::Matrix<S, 3, 1>& upsilon) {
    SmallCholesky<S, 3> factor;
    if (!factor.compute(covariance.template topLeftCorner<3, 3>())) return Eigen::Matrix<S, 3, 1>::Zero();
    const Eigen::Matrix<S, 3, 1> omega = covariance.template bottomLeftCorner<3, 3>() * factor.solve(upsilon);
    return omega.allFinite() ? omega : Eigen::Matrix<S, 3, 1>::Zero().eval();
  }

  std::span<TrackedPose<S>> poses_;
  const SmoothingOptions& options_;
  SmoothingWorkspace& ws_;
};

}  // namespace detail

/// Poses of a whole trajectory, each found by itself, brought together by what is known of how a camera
/// moves: its centre has no jerks. A frame's pose errs by millimetres into the direction that its points tell
/// least, another one for each frame (rolling shutters, smeared patches, a mover in front), and turns as far
/// to make up for it; the hand goes on evenly meanwhile.
///
/// Minimises sum_i w_i |c_i - c_i'|^2 + stiffness sum_i |third difference of c'|^2, a smoothing spline in
/// discrete time (Whittaker 1923), over the camera's centres. w_i is by the pose's covariance and a
/// t-distribution. The stiffness is the one with which each pose is told best by all the others (leave one
/// out, Craven and Wahba 1979, in one pass by the leverage), so there is nothing to tune: where poses are
/// better than that, next to nothing is changed. A hand's turns are jerky, and are not smoothed; but each
/// pose is turned as its covariance ties the turn to the shift, so that what it sees stays where it is seen.
/// Linear in the number of poses; calculates in double.
/// @param poses  in and out, in the order of their times
template <std::floating_point S>
SmoothingResult smooth_trajectory(std::span<TrackedPose<S>> poses, const SmoothingOptions& options,
                                  SmoothingWorkspace& workspace) {
  return detail::TrajectorySmoother<S>(poses, options, workspace).run();
}

/// The same for those who try it once: memory of its own.
template <std::floating_point S>
SmoothingResult smooth_trajectory(std::span<TrackedPose<S>> poses, const SmoothingOptions& options = {}) {
  SmoothingWorkspace workspace;
  return smooth_trajectory<S>(poses, options, workspace);
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
