// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "dynslam/optim/pose.hpp"

namespace dynslam {

template <Scalar S>
struct PoseConsensusOptions {
  int hypotheses = 80;     ///< minimal samples that are tried
  int iterations = 3;      ///< Gauss-Newton steps per sample
  S truncation = S(6);     ///< squared normalised error beyond which an observation counts as an outlier
  std::uint64_t seed = 1;  ///< same seed, same result
};

template <Scalar S>
struct PoseConsensus {
  SE3<S> T_c_w;
  S cost = std::numeric_limits<S>::infinity();  ///< sum of truncated squared normalised errors
  int inliers = 0;                              ///< observations below the truncation
};

/// The pose that most observations agree on, where several rigid motions compete (people and things
/// that move before a static scene).
///
/// A robust kernel on all observations finds a compromise: the rotation that nearly follows a distant
/// background can be traded for the translation that follows a near mover. Here poses are proposed by
/// small samples, refined from the predicted pose, and compared by a truncated cost with the pixel
/// accuracy of a true match (MSAC, Torr and Zisserman 2000), in which a mover costs the same however
/// far it has gone. `T_c_w_predicted` and `alternatives` compete, too.
/// @param observations  reprojection and depth, as for optimize_pose
template <std::floating_point S>
[[nodiscard]] PoseConsensus<S> pose_consensus(const Pinhole<S>& camera,
                                              std::span<const PoseObservation<S>> observations,
                                              const SE3<S>& T_c_w_predicted,
                                              std::span<const SE3<S>> alternatives,
                                              const PoseConsensusOptions<S>& options = {}) {
  constexpr std::size_t kSample = 4;
  PoseConsensus<S> best;
  best.T_c_w = T_c_w_predicted;
  const std::size_t n = observations.size();
  const auto chi2 = [&](const PoseObservation<S>& o, const Eigen::Matrix<S, 3, 1>& r) {
    const S pixel = o.inv_sigma_px2 * (r.x() * r.x() + r.y() * r.y());
    return o.inv_sigma_z2 > S(0) && is_valid_depth(o.depth) ? pixel + o.inv_sigma_z2 * r.z() * r.z() : pixel;
  };
  const auto judge = [&](const SE3<S>& T) {
    S cost = S(0);
    int inliers = 0;
    Eigen::Matrix<S, 3, 1> r;
    for (const PoseObservation<S>& o : observations) {
      S e = options.truncation;
      if (pose_residual<S>(camera, T, o, r, nullptr)) e = std::min(e, chi2(o, r));
      inliers += e < options.truncation ? 1 : 0;
      cost += e;
      if (cost >= best.cost) return;
    }
    best = {T, cost, inliers};
  };
  judge(T_c_w_predicted);
  for (const SE3<S>& T : alternatives) judge(T);
  if (n < kSample) return best;

  std::uint64_t state = options.seed;
  const auto draw = [&] {  // splitmix64: the standard library's distributions differ between platforms
    std::uint64_t z = (state += 0x9E3779B97F4A7C15ULL);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
    return static_cast<std::size_t>((z ^ (z >> 31)) % n);
  };
  NormalEquations<S, 6> system;
  for (int h = 0; h < options.hypotheses; ++h) {
    std::array<std::size_t, kSample> sample{};
    for (std::size_t k = 0; k < kSample; ++k) {
      do {
        sample[k] = draw();
      } while (std::find(sample.begin(), sample.begin() + static_cast<std::ptrdiff_t>(k), sample[k]) !=
               sample.begin() + static_cast<std::ptrdiff_t>(k));
    }
    SE3<S> T = T_c_w_predicted;
    bool usable = true;
    for (int i = 0; i < options.iterations && usable; ++i) {
      system.set_zero();
      Eigen::Matrix<S, 3, 1> r;
      Eigen::Matrix<S, 3, 6> J;
      for (const std::size_t k : sample) {
        const PoseObservation<S>& o = observations[k];
        if (!pose_residual(camera, T, o, r, &J)) {
          usable = false;
          break;
        }
        system.add_row(J.row(0), r.x(), o.inv_sigma_px2);
        system.add_row(J.row(1), r.y(), o.inv_sigma_px2);
        if (o.inv_sigma_z2 > S(0) && is_valid_depth(o.depth)) system.add_row(J.row(2), r.z(), o.inv_sigma_z2);
      }
      Eigen::Matrix<S, 6, 1> step;
      usable = usable && system.solve(S(0), step);
      if (usable) T = SE3<S>::exp(step) * T;
    }
    if (usable) judge(T);
  }
  return best;
}

}  // namespace dynslam
