// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "dynslam/geometry/rigid_alignment.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/optim/pose_residual.hpp"
#include "dynslam/robust/split_mix64.hpp"

namespace dynslam {

template <Scalar S>
struct AbsolutePoseOptions {
  int hypotheses = 300;     ///< minimal samples at most; fewer once the best one's inliers allow it
  S confidence = S(0.999);  ///< that a sample without an outlier was among them
  S truncation = S(16);     ///< squared normalised error beyond which an observation counts as an outlier
  std::uint64_t seed = 1;   ///< same seed, same result
};

enum class AbsolutePoseStatus : std::uint8_t {
  found,
  too_few_observations,  ///< fewer than three with depth
  no_consensus           ///< no sample gave a pose
};

template <Scalar S>
struct AbsolutePoseResult {
  AbsolutePoseStatus status = AbsolutePoseStatus::too_few_observations;
  SE3<S> T_c_w;                                 ///< identity on failure
  S cost = std::numeric_limits<S>::infinity();  ///< sum of truncated squared normalised errors
  int inliers = 0;                              ///< observations below the truncation
  int hypotheses = 0;                           ///< tried
  [[nodiscard]] bool ok() const { return status == AbsolutePoseStatus::found; }
};

/// Memory of absolute_pose; keep it between calls to avoid allocation.
struct AbsolutePoseWorkspace {
  std::vector<std::size_t> measured;  // observations with depth
};

namespace detail {

/// The pose of three observations with depth; nullopt where they are no view of one rigid scene.
template <std::floating_point S, class Camera>
[[nodiscard]] std::optional<SE3<S>> pose_of_sample(const Camera& camera,
                                                   std::span<const PoseObservation<S>> observations,
                                                   const std::array<std::size_t, 3>& sample, S truncation) {
  std::array<Eigen::Matrix<S, 3, 1>, 3> measured, mapped;
  for (std::size_t k = 0; k < sample.size(); ++k) {
    const PoseObservation<S>& o = observations[sample[k]];
    const auto p = camera.unproject(o.x, o.depth);
    if (!p) return std::nullopt;
    measured[k] = *p;
    mapped[k] = o.p_w;
  }
  // A rigid motion keeps lengths: most samples with a wrong match are seen through here.
  for (std::size_t a = 0; a < sample.size(); ++a) {
    const std::size_t b = (a + 1) % sample.size();
    const S slack = std::sqrt(truncation) * (S(1) / std::sqrt(observations[sample[a]].inv_sigma_z2) +
                                             S(1) / std::sqrt(observations[sample[b]].inv_sigma_z2));
    if (!(std::abs((measured[a] - measured[b]).norm() - (mapped[a] - mapped[b]).norm()) <= slack))
      return std::nullopt;
  }
  return horn_alignment<S>(mapped, measured);
}

/// How many samples are needed to draw one without an outlier, with the given confidence.
template <std::floating_point S>
[[nodiscard]] int samples_needed(S inlier_share, S confidence, int at_most) {
  const S all_good = inlier_share * inlier_share * inlier_share;
  if (all_good >= S(1)) return 0;
  if (!(all_good > S(0))) return at_most;
  const S wanted = std::log(S(1) - confidence) / std::log(S(1) - all_good);
  return wanted < static_cast<S>(at_most) ? static_cast<int>(std::ceil(wanted)) : at_most;
}

}  // namespace detail

/// The pose from observations of map points alone, without a guess (relocalisation, loop closing), where
/// most matches may be wrong: three with depth give a pose by Horn's alignment of the measured
/// points with the map's, and the one with the least truncated reprojection and depth cost wins (MSAC).
/// It is a start for optimize_pose, not its replacement.
/// @param camera  any camera; the observations are its pixels
/// @param observations  those without depth only vote
template <std::floating_point S, CameraOf<S> Camera>
[[nodiscard]] AbsolutePoseResult<S> absolute_pose(const Camera& camera,
                                                  std::span<const PoseObservation<S>> observations,
                                                  const AbsolutePoseOptions<S>& options,
                                                  AbsolutePoseWorkspace& workspace) {
  AbsolutePoseResult<S> best;
  workspace.measured.clear();
  for (std::size_t k = 0; k < observations.size(); ++k) {
    if (measures_depth(observations[k])) workspace.measured.push_back(k);
  }
  const std::size_t n = workspace.measured.size();
  if (n < 3) return best;
  best.status = AbsolutePoseStatus::no_consensus;
  SplitMix64 random(options.seed);
  const auto draw = [&] { return workspace.measured[random.index(n)]; };
  for (int needed = options.hypotheses; best.hypotheses < needed;) {
    ++best.hypotheses;
    const std::array<std::size_t, 3> sample{draw(), draw(), draw()};
    if (sample[0] == sample[1] || sample[0] == sample[2] || sample[1] == sample[2]) continue;
    const auto T = detail::pose_of_sample<S>(camera, observations, sample, options.truncation);
    if (!T) continue;
    const auto motion = T->isometry();
    S cost = S(0);
    int inliers = 0;
    for (const PoseObservation<S>& o : observations) {
      const S e = std::min(options.truncation, observation_chi2(camera, motion, o));
      inliers += e < options.truncation ? 1 : 0;
      cost += e;
      if (cost >= best.cost) break;
    }
    if (cost >= best.cost) continue;
    best.status = AbsolutePoseStatus::found;
    best.cost = cost;
    best.T_c_w = *T;
    best.inliers = inliers;
    needed = detail::samples_needed(static_cast<S>(inliers) / static_cast<S>(observations.size()),
                                    options.confidence, needed);
  }
  return best;
}

/// The same for those who try it once.
template <std::floating_point S, CameraOf<S> Camera>
[[nodiscard]] AbsolutePoseResult<S> absolute_pose(const Camera& camera,
                                                  std::span<const PoseObservation<S>> observations,
                                                  const AbsolutePoseOptions<S>& options = {}) {
  AbsolutePoseWorkspace workspace;
  return absolute_pose<S>(camera, observations, options, workspace);
}

}  // namespace dynslam
