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
#include "dynslam/geometry/small_cholesky.hpp"
#include "dynslam/optim/banded_system.hpp"
#include "dynslam/robust/chi_square.hpp"

namespace dynslam {

/// Options of smooth_trajectory.
struct SmoothingOptions {
  double nu = 5;              ///< degrees of freedom of the t-distribution of the poses' errors
  int iterations = 8;         ///< of the weights by that
  double longest_gap = 0.15;  ///< without a pose [s]: half a period of 3 Hz, the fastest that a hand moves
  int min_poses = 12;         ///< in a row: of fewer the noise cannot be told
  /// Between the largest and the smallest weight of two poses: covariances of matches know no common error.
  double max_ratio = 100;
  /// Farthest that a pose is moved, in its own standard deviations: recorded outliers lie at 3 to 8, what
  /// lies farther is taken for a motion.
  double max_move = 16;
  /// By how much a squared error of prediction has to differ before it is taken for more than chance: of 15
  /// poses with 3 components it varies by a fifth.
  double margin = 1.8;
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
  double stiffness = 0;   ///< weight of the motion's third differences against a usual pose's error; 0: none
  double noise = 0;       ///< by how far a pose lies beside what its neighbours say, RMS [m]
  double correction = 0;  ///< by how far the centres were moved, RMS [m]
  double clock = 0;       ///< standard deviation of the times that the motion shows [s]
  std::size_t unchanged = 0;  ///< poses that were left as measured
  [[nodiscard]] bool ok() const { return status == SmoothingStatus::smoothed; }
};

/// Memory of smooth_trajectory; keep it between calls to avoid allocation.
struct SmoothingWorkspace {
  std::vector<double> weight, robust, leverage, best_leverage, noise, rough, along, speed2, sorted;
  std::vector<char> left;
  std::vector<Eigen::Vector3d> centre, smooth, best;
  std::array<std::vector<double>, 3> axis;        ///< of the smooth centres: x, y, z
  std::array<std::vector<double>, 9> squared;     ///< errors of prediction, by stiffness
  std::vector<std::array<double, 4>> difference;  ///< third ones, of poses i to i + 3; 0: a gap
  BandedSystem<double, 3> system;
};

namespace detail {

template <std::floating_point S>
class TrajectorySmoother {
 public:
  TrajectorySmoother(std::span<TrackedPose<S>> poses, const SmoothingOptions& options, SmoothingWorkspace& ws)
      : poses_(poses), options_(options), ws_(ws), n_(poses.size()) {}

  SmoothingResult run() {
    SmoothingResult result;
    for (std::size_t i = 0; i < n_; ++i) {
      if (std::isfinite(poses_[i].t) && (i == 0 || poses_[i].t > poses_[i - 1].t)) continue;
      result.status = SmoothingStatus::not_increasing;
      return result;
    }
    if (!find_differences()) return result;
    find_weights();
    find_noise();
    double softest = 0, best = std::numeric_limits<double>::infinity(), stiffness = kSoftest;
    std::size_t chosen = 0;
    for (std::size_t k = 0; k < ws_.squared.size(); ++k, stiffness *= kStep) {
      const double error = fit(stiffness, ws_.squared[k]);
      if (k == 0) softest = error;
      if (!(error < best)) continue;
      best = error;
      chosen = k;
      result.stiffness = stiffness;
      ws_.best_leverage.assign(ws_.leverage.begin(), ws_.leverage.end());
      ws_.best.assign(ws_.smooth.begin(), ws_.smooth.end());
    }
    if (!std::isfinite(best)) return result;
    result.status = SmoothingStatus::smoothed;
    result.noise = std::sqrt(best);
    if (best * options_.margin > softest) {  // neighbours know nothing of a pose
      result.stiffness = 0;
      ws_.best.assign(ws_.centre.begin(), ws_.centre.end());
    }
    keep_motion(chosen);
    result.clock = keep_clock();
    result.correction = apply(result.unchanged);
    return result;
  }

 private:
  // From a motion that says nothing to one whose poses say nothing; a step changes the width by half.
  static constexpr double kSoftest = 1e-3, kStep = 10;
  static constexpr std::size_t kAround = 7;  // poses to either side that tell what is usual

  [[nodiscard]] bool finite(std::size_t i) const {
    return poses_[i].T_c_w.translation().allFinite() && poses_[i].T_c_w.so3().matrix().allFinite();
  }
  [[nodiscard]] bool joined(std::size_t i) const {  // with the pose before
    return !poses_[i].begins && poses_[i].t - poses_[i - 1].t <= options_.longest_gap && finite(i) &&
           finite(i - 1);
  }
  [[nodiscard]] std::size_t first_around(std::size_t i) const { return i < kAround ? 0 : i - kAround; }
  [[nodiscard]] std::size_t end_around(std::size_t i) const { return std::min(n_, i + kAround + 1); }

  /// Third differences of four poses in a row, those of an even motion at the usual interval being
  /// (-1, 3, -3, 1). @return whether there are any
  [[nodiscard]] bool find_differences() {
    ws_.difference.assign(n_, {});
    ws_.sorted.clear();
    for (std::size_t i = 1; i < n_; ++i) {
      if (joined(i)) ws_.sorted.push_back(poses_[i].t - poses_[i - 1].t);
    }
    if (ws_.sorted.empty()) return false;
    const double usual = median();
    bool any = false;
    for (std::size_t begin = 0, end = 1; begin < n_; begin = end++) {
      while (end < n_ && joined(end)) ++end;
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
      const auto v = static_cast<double>(pose.covariance.template topLeftCorner<3, 3>().trace());
      return std::isfinite(v) ? v : 0.0;
    };
    ws_.sorted.clear();
    for (const TrackedPose<S>& pose : poses_) {
      if (variance(pose) > 0) ws_.sorted.push_back(variance(pose));
    }
    const double usual = ws_.sorted.empty() ? 1 : median(), most = std::sqrt(options_.max_ratio);
    ws_.weight.clear();
    ws_.centre.clear();
    for (std::size_t i = 0; i < n_; ++i) {
      const double v = variance(poses_[i]);
      ws_.weight.push_back(v > 0 ? std::clamp(usual / v, 1 / most, most) : 1.0);
      const Eigen::Vector3d before = i == 0 ? Eigen::Vector3d::Zero().eval() : ws_.centre.back();
      ws_.centre.push_back(finite(i) ? poses_[i].T_c_w.inverse().translation().template cast<double>().eval()
                                     : before);
    }
  }

  /// The poses' noise [m^2, of each axis, of a pose of weight 1] as third differences around each tell: their
  /// median, which is none of a jolt's. And their shares along the path and beside it.
  void find_noise() {
    ws_.rough.assign(n_, -1);
    ws_.along.assign(n_, 0);
    ws_.speed2.assign(n_, 0);
    for (std::size_t i = 0; i + 3 < n_; ++i) {
      const std::array<double, 4>& d = ws_.difference[i];
      if (d[3] == 0) continue;
      Eigen::Vector3d rough = Eigen::Vector3d::Zero();
      double scale = d[0] * d[0] / ws_.weight[i];
      for (std::size_t j = 1; j < 4; ++j) {
        rough += d[j] * (ws_.centre[i + j] - ws_.centre[i]);
        scale += d[j] * d[j] / ws_.weight[i + j];
      }
      const Eigen::Vector3d path = ws_.centre[i + 3] - ws_.centre[i];
      const double product = rough.dot(path), path2 = path.squaredNorm();
      const double seconds = poses_[i + 3].t - poses_[i].t;
      ws_.rough[i] = rough.squaredNorm() / scale;
      ws_.along[i] = path2 > 0 ? product * product / path2 / scale : 0;
      ws_.speed2[i] = path2 / (seconds * seconds);
    }
    ws_.noise.assign(n_, 0);
    for (std::size_t i = 0; i < n_; ++i) {
      ws_.sorted.clear();
      for (std::size_t j = std::max<std::size_t>(1, first_around(i)); j < end_around(i); ++j) {
        if (ws_.rough[j - 1] >= 0) ws_.sorted.push_back(ws_.rough[j - 1]);
      }
      if (!ws_.sorted.empty()) ws_.noise[i] = median() / kChiSquareMedian3;
    }
  }

  /// Smooths with a stiffness. @param squared  how far poses lie from what all the others say of them:
  /// squared and weighted [m^2]
  /// @return their mean, what is far off alone counting less; infinite where nothing can be solved
  [[nodiscard]] double fit(double stiffness, std::vector<double>& squared) {
    ws_.robust.assign(ws_.weight.begin(), ws_.weight.end());
    ws_.leverage.resize(n_);
    squared.assign(n_, 0);
    double error = std::numeric_limits<double>::infinity();
    for (int iteration = 0; iteration < std::max(1, options_.iterations); ++iteration) {
      if (!solve(stiffness)) return std::numeric_limits<double>::infinity();
      double sum = 0;
      for (std::size_t i = 0; i < n_; ++i) {
        // The residual through what is left of a pose's own say.
        const double own = 1 - ws_.leverage[i] * ws_.robust[i];
        const double residual2 = (ws_.centre[i] - ws_.smooth[i]).squaredNorm();
        squared[i] = own > 1e-9 ? ws_.weight[i] * residual2 / (own * own) : 0;
        const double normalised = ws_.noise[i] > 0 ? squared[i] * own / ws_.noise[i] : 3;
        const double doubt = (options_.nu + 3) / (options_.nu + normalised);
        ws_.robust[i] = ws_.weight[i] * doubt;
        sum += squared[i] * std::min(1.0, doubt);
      }
      error = sum / static_cast<double>(n_);
    }
    return error;
  }

  [[nodiscard]] bool solve(double stiffness) {
    auto& system = ws_.system;
    system.reset(n_);
    for (std::size_t i = 0; i < n_; ++i) system.at(i, 0) = ws_.robust[i];
    for (std::size_t i = 0; i + 3 < n_; ++i) {
      for (std::size_t j = 0; j < 4; ++j) {
        for (std::size_t k = j; k < 4; ++k)
          system.at(i + j, k - j) += stiffness * ws_.difference[i][j] * ws_.difference[i][k];
      }
    }
    if (!system.factor()) return false;
    ws_.smooth.resize(n_);
    for (std::size_t a = 0; a < 3; ++a) {
      // Of the deviation from the first pose: coordinates far from the origin lose no digits.
      const auto at = static_cast<Eigen::Index>(a);
      std::vector<double>& x = ws_.axis[a];
      x.resize(n_);
      for (std::size_t i = 0; i < n_; ++i) x[i] = ws_.robust[i] * (ws_.centre[i](at) - ws_.centre[0](at));
      system.solve(x);
      for (std::size_t i = 0; i < n_; ++i) ws_.smooth[i](at) = x[i] + ws_.centre[0](at);
    }
    system.inverse_diagonal(ws_.leverage);
    return true;
  }

  /// Leaves as measured the poses around which a softer motion predicts better, and those that would be moved
  /// too far, with all that share a third difference with them: a jolt.
  void keep_motion(std::size_t chosen) {
    ws_.left.assign(n_, 0);
    for (std::size_t i = 0; i < n_; ++i) {
      const double moved2 = (ws_.best[i] - ws_.centre[i]).squaredNorm();
      // Of the movement: a pose's own variance, but for what it has contributed itself.
      const double free = 1 - std::min(1.0, ws_.weight[i] * ws_.best_leverage[i]);
      const double own = free * ws_.noise[i] / std::min(1.0, ws_.weight[i]);
      if (moved2 > options_.max_move * options_.max_move * own) {
        for (std::size_t j = i < 3 ? 0 : i - 3; j < std::min(n_, i + 4); ++j) ws_.left[j] = 1;
      }
      const double error = around(ws_.squared[chosen], i);
      for (std::size_t k = 0; k < chosen; ++k) {
        if (error > options_.margin * around(ws_.squared[k], i)) ws_.left[i] = 1;
      }
    }
    for (std::size_t i = 0; i < n_; ++i) {
      if (ws_.left[i] != 0) ws_.best[i] = ws_.centre[i];
    }
  }
  [[nodiscard]] double around(const std::vector<double>& values, std::size_t i) const {
    double sum = 0;
    for (std::size_t j = first_around(i); j < end_around(i); ++j) sum += values[j];
    return sum;
  }

  /// A stamp that errs shows as noise along the path alone, by the more the faster the camera is, and the
  /// pose is right: what that has of the noise is taken from the movement along the path.
  /// @return the stamps' standard deviation [s]
  double keep_clock() {
    const auto beside = [&](std::size_t i) {  // the path, as the poses around tell [m^2, of an axis]
      double sum = 0, count = 0;
      for (std::size_t j = first_around(i); j < end_around(i); ++j) {
        if (ws_.rough[j] >= 0) sum += (ws_.rough[j] - ws_.along[j]) / 2, ++count;
      }
      return count > 0 ? sum / count : 0.0;
    };
    ws_.sorted.clear();
    for (std::size_t i = 0; i < n_; ++i) {
      if (ws_.rough[i] >= 0 && ws_.speed2[i] > 0)
        ws_.sorted.push_back((ws_.along[i] / kChiSquareMedian1 - beside(i)) / ws_.speed2[i]);
    }
    const double clock2 = ws_.sorted.empty() ? 0 : std::max(0.0, median());
    for (std::size_t i = 0; i < n_ && clock2 > 0; ++i) {
      const std::size_t first = i > 0 ? i - 1 : 0, last = std::min(n_ - 1, i + 1);
      const Eigen::Vector3d path = ws_.centre[last] - ws_.centre[first];
      const double path2 = path.squaredNorm(), seconds = poses_[last].t - poses_[first].t;
      if (!(path2 > 0)) continue;
      const double by_clock = clock2 * path2 / (seconds * seconds);
      const double share = by_clock / (by_clock + beside(i));
      ws_.best[i] -= share * path.dot(ws_.best[i] - ws_.centre[i]) / path2 * path;
    }
    return std::sqrt(clock2);
  }

  /// Moves the centres to the best ones and turns the poses as their covariances say that a pose which is off
  /// by so much is turned. @return RMS of the movement [m]
  double apply(std::size_t& unchanged) {
    double sum = 0;
    for (std::size_t i = 0; i < n_; ++i) {
      TrackedPose<S>& pose = poses_[i];
      const Eigen::Matrix<S, 3, 1> centre = ws_.best[i].template cast<S>();
      const Eigen::Matrix<S, 3, 1> moved = (ws_.best[i] - ws_.centre[i]).template cast<S>();
      if (moved.isZero(S(0)) || !finite(i)) {
        ++unchanged;
        continue;
      }
      sum += static_cast<double>(moved.squaredNorm());
      const Eigen::Matrix<S, 3, 1> upsilon = -(pose.T_c_w.so3() * moved);
      const SO3<S> R = SO3<S>::exp(turn_of(pose.covariance, upsilon)) * pose.T_c_w.so3();
      pose.T_c_w = SE3<S>(R, -(R * centre));
    }
    return std::sqrt(sum / static_cast<double>(std::max<std::size_t>(1, n_)));
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
  std::size_t n_;
};

}  // namespace detail

/// Averages the errors that the poses of a trajectory have each by itself, where the camera moves smoothly,
/// and leaves the poses as they were measured where it does not.
///
/// Minimises sum_i w_i |c_i - c_i'|^2 + stiffness sum_i |third difference of c'|^2 over the camera's centres,
/// a smoothing spline in discrete time (Whittaker 1923). w_i is by the pose's covariance and a
/// t-distribution. The stiffness is the one with which each pose is told best by all the others (leave one
/// out, Craven and Wahba 1979, in one pass by the leverage). The noise of a pose is estimated where it is, by
/// the median of the third differences around (Rice 1984): covariances are known up to a factor. A pose is
/// left
/// - where a softer spline predicts those around better by `margin`: brakes, stops, shaking;
/// - if it would be moved by more than `max_move` of its own standard deviations: a jolt;
/// - everywhere, if the softest spline predicts no worse by `margin` than the best: few poses per second.
/// Noise beside the path is a pose's, more of it along the path is a stamp's, whose pose is right: the
/// movement along the path is shrunk by the share of the two. A movement like noise, white and within
/// `max_move`, cannot be told from noise.
/// Turns are not smoothed, for those of a hand are jerky; but each pose is turned as its covariance ties the
/// turn to the shift, so that what it sees stays where it is seen.
/// Linear in the number of poses; calculates in double. Poses that are not finite are left and join nothing;
/// a covariance that is not counts as unknown.
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
