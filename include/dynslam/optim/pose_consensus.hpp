// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "dynslam/optim/pose.hpp"
#include "dynslam/robust/split_mix64.hpp"

namespace dynslam {

template <Scalar S>
struct PoseConsensusOptions {
  int hypotheses = 120;    ///< minimal samples that are tried
  int iterations = 3;      ///< Gauss-Newton steps per sample, and per refinement
  S truncation = S(6);     ///< squared normalised error beyond which an observation counts as an outlier
  std::uint64_t seed = 1;  ///< same seed, same result
  // How far from its prediction a pose is likely to be. Where little is seen, some samples of it fit any
  // motion.
  S prior_share = S(0);           ///< the prediction counts as this share of all observations; 0: not at all
  S prior_translation = S(0.03);  ///< standard deviation [m]
  S prior_rotation = S(0.03);     ///< standard deviation [rad]
};

template <Scalar S>
struct PoseConsensus {
  SE3<S> T_c_w;
  S cost = std::numeric_limits<S>::infinity();  ///< weighted sum of truncated squared normalised errors
  int inliers = 0;                              ///< observations below the truncation
};

/// How surface_weights() divides the image.
template <Scalar S>
struct SurfaceOptions {
  int width = 640, height = 480;  ///< of the image [px]
  int step = 20;                  ///< between the places that are given to an observation [px]
  S reach = S(100);               ///< farther from every observation, a place is given to none [px]
  S max_depth = S(4);             ///< farther surfaces count as if they were there [m]
};

/// Weights with which observations count by the surface that they stand for: each place of the image belongs
/// to the nearest observation, and counts with its depth. Of several motions that are seen, the scene's is
/// the one that most surface shares. Features do not tell: a poster that is carried past has more of them
/// than the room behind it; nor do pixels: what moves is in front of what does not, and looks large. A
/// place's surface grows with z^2, but so does the noise of its depth; z is between the two.
/// @param T_c_w  rough pose, for depths that were not measured
/// @param out    one positive weight per observation [places x m]
template <std::floating_point S>
void surface_weights(const SE3<S>& T_c_w, std::span<const PoseObservation<S>> observations,
                     const SurfaceOptions<S>& options, std::vector<S>& out) {
  constexpr S kCrowdedOut = S(0.25);  // places of an observation to which no place is nearest
  out.assign(observations.size(), kCrowdedOut);
  for (int v = options.step / 2; v < options.height; v += options.step) {
    for (int u = options.step / 2; u < options.width; u += options.step) {
      S nearest = options.reach * options.reach;
      std::size_t owner = observations.size();
      for (std::size_t k = 0; k < observations.size(); ++k) {
        const S dx = observations[k].x.x() - S(u), dy = observations[k].x.y() - S(v);
        const S distance2 = dx * dx + dy * dy;
        if (distance2 < nearest) {
          nearest = distance2;
          owner = k;
        }
      }
      if (owner < observations.size()) out[owner] += S(1);
    }
  }
  for (std::size_t k = 0; k < out.size(); ++k) {
    const PoseObservation<S>& o = observations[k];
    const S z =
        std::min(is_valid_depth(o.depth) ? o.depth : std::abs((T_c_w * o.p_w).z()), options.max_depth);
    out[k] *= z;
  }
}

/// The pose that most observations agree on, where several rigid motions compete (people and things
/// that move before a static scene).
///
/// A robust kernel on all observations finds a compromise: the rotation that nearly follows a distant
/// background can be traded for the translation that follows a near mover. Here poses are proposed by
/// small samples, refined from the predicted pose, and compared by a truncated cost with the pixel
/// accuracy of a true match (MSAC, Torr and Zisserman 2000), in which a mover costs the same however
/// far it has gone. Each new best pose is refined on what agrees with it (LO-RANSAC, Chum et al. 2003).
/// `T_c_w_predicted` and `alternatives` compete, too.
/// @param observations  reprojection and depth, as for optimize_pose
/// @param weights  per observation, positive; empty: all equal. An observation is sampled and counts by its
///                 weight. See surface_weights().
template <std::floating_point S>
[[nodiscard]] PoseConsensus<S> pose_consensus(const Pinhole<S>& camera,
                                              std::span<const PoseObservation<S>> observations,
                                              const SE3<S>& T_c_w_predicted,
                                              std::span<const SE3<S>> alternatives,
                                              const PoseConsensusOptions<S>& options = {},
                                              std::span<const S> weights = {}) {
  constexpr std::size_t kSample = 3;  // with depth, three points determine a pose
  constexpr S kNoLimit = std::numeric_limits<S>::infinity();
  PoseConsensus<S> best;
  best.T_c_w = T_c_w_predicted;
  const std::size_t n = observations.size();
  const auto weight = [&](std::size_t k) { return weights.empty() ? S(1) : weights[k]; };
  S prior_weight = S(0);
  for (std::size_t k = 0; k < n; ++k) prior_weight += options.prior_share * weight(k);
  const SE3<S> T_w_predicted = T_c_w_predicted.inverse();
  const auto prior_chi2 = [&](const SE3<S>& T) {
    const SE3<S> step = T * T_w_predicted;
    return step.translation().squaredNorm() / (options.prior_translation * options.prior_translation) +
           step.so3().log().squaredNorm() / (options.prior_rotation * options.prior_rotation);
  };
  const auto judge = [&](const SE3<S>& T) {
    const auto motion = T.isometry();
    S cost = prior_weight > S(0) ? prior_weight * std::min(options.truncation, prior_chi2(T)) : S(0);
    int inliers = 0;
    for (std::size_t k = 0; k < n; ++k) {
      const S e = std::min(options.truncation, observation_chi2(camera, motion, observations[k]));
      inliers += e < options.truncation ? 1 : 0;
      cost += weight(k) * e;
      if (cost >= best.cost) return false;
    }
    best = {T, cost, inliers};
    return true;
  };
  NormalEquations<S, 6> system;
  PoseEquations<S> sums;
  using Motion = Eigen::Transform<S, 3, Eigen::Isometry>;
  // Adds an observation whose squared normalised error is below the limit.
  const auto add = [&](const PoseObservation<S>& o, const Motion& motion, S limit) {
    Eigen::Matrix<S, 3, 1> r;
    const Eigen::Matrix<S, 3, 1> p = motion * o.p_w;
    if (!point_residual(camera, p, o, r) || !(observation_chi2(o, r) < limit)) return false;
    sums.add(camera, p, r, o.inv_sigma_px2, measures_depth(o) ? o.inv_sigma_z2 : S(0));
    return true;
  };
  const auto solve = [&](Eigen::Matrix<S, 6, 1>& step) {
    sums.store(system);
    return system.solve(S(0), step);
  };
  const auto refine = [&] {
    Eigen::Matrix<S, 6, 1> step;
    for (int i = 0; i < options.iterations; ++i) {
      sums.set_zero();
      const Motion motion = best.T_c_w.isometry();
      for (const PoseObservation<S>& o : observations) (void)add(o, motion, options.truncation);
      if (!solve(step) || !judge(SE3<S>::exp(step) * best.T_c_w)) return;
    }
  };
  judge(T_c_w_predicted);
  for (const SE3<S>& T : alternatives) judge(T);
  if (n < kSample) return best;

  SplitMix64 random(options.seed);
  const S heaviest = weights.empty() ? S(1) : *std::max_element(weights.begin(), weights.end());
  const auto draw_observation = [&] {
    constexpr int kRefusals = 1000;  // weights that differ by more than this are no longer told apart
    std::size_t k = 0;
    for (int trial = 0; trial < kRefusals; ++trial) {
      k = random.index(n);
      if (weights.empty() || random.unit<S>() * heaviest < weights[k]) break;
    }
    return k;
  };
  for (int h = 0; h < options.hypotheses; ++h) {
    std::array<std::size_t, kSample> sample{};
    for (std::size_t k = 0; k < kSample; ++k) {
      do {
        sample[k] = draw_observation();
      } while (std::find(sample.begin(), sample.begin() + static_cast<std::ptrdiff_t>(k), sample[k]) !=
               sample.begin() + static_cast<std::ptrdiff_t>(k));
    }
    SE3<S> T = T_c_w_predicted;
    bool usable = true;
    for (int i = 0; i < options.iterations && usable; ++i) {
      sums.set_zero();
      const Motion motion = T.isometry();
      for (const std::size_t k : sample) usable = usable && add(observations[k], motion, kNoLimit);
      Eigen::Matrix<S, 6, 1> step;
      usable = usable && solve(step);
      if (usable) T = SE3<S>::exp(step) * T;
    }
    if (usable && judge(T)) refine();
  }
  return best;
}

}  // namespace dynslam
