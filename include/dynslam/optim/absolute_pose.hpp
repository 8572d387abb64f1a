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

#include "dynslam/geometry/rigid_alignment.hpp"
#include "dynslam/optim/pose.hpp"
#include "dynslam/robust/split_mix64.hpp"

namespace dynslam {

template <Scalar S>
struct AbsolutePoseOptions {
  int max_hypotheses = 300;  ///< minimal samples at most; fewer once the best one's inliers allow it
  S confidence = S(0.999);   ///< that a sample without an outlier was among them
  S truncation = S(16);      ///< squared normalised error beyond which a match counts as an outlier
  std::uint64_t seed = 1;    ///< same seed, same result
};

template <Scalar S>
struct AbsolutePose {
  bool found = false;
  SE3<S> T_c_w;
  int inliers = 0;
  int hypotheses = 0;  ///< tried
};

/// Memory of absolute_pose.
struct AbsolutePoseWorkspace {
  std::vector<std::size_t> measured;  // matches with depth
};

/// The pose from matches to map points alone, without a guess (relocalisation, loop closing), where
/// most matches may be wrong: three matches with depth give a pose by Horn's alignment of the measured
/// points with the map's, and the one with the least truncated reprojection and depth cost wins (MSAC).
/// It is a start for optimize_pose, not its replacement.
/// @param matches  map point, ideal pixel, depth and their accuracies; those without depth only vote
template <std::floating_point S>
[[nodiscard]] AbsolutePose<S> absolute_pose(const Pinhole<S>& camera,
                                            std::span<const PoseObservation<S>> matches,
                                            const AbsolutePoseOptions<S>& options,
                                            AbsolutePoseWorkspace& ws) {
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  constexpr std::size_t kSample = 3;
  AbsolutePose<S> best;
  ws.measured.clear();
  for (std::size_t k = 0; k < matches.size(); ++k) {
    if (measures_depth(matches[k])) ws.measured.push_back(k);
  }
  const std::size_t n = ws.measured.size();
  if (n < kSample) return best;
  SplitMix64 random(options.seed);
  const auto draw = [&] { return ws.measured[random.index(n)]; };
  S best_cost = std::numeric_limits<S>::infinity();
  int needed = options.max_hypotheses;
  std::array<Vector3, kSample> measured, mapped;
  while (best.hypotheses < needed) {
    ++best.hypotheses;
    std::array<std::size_t, kSample> sample{draw(), draw(), draw()};
    if (sample[0] == sample[1] || sample[0] == sample[2] || sample[1] == sample[2]) continue;
    for (std::size_t k = 0; k < kSample; ++k) {
      const PoseObservation<S>& o = matches[sample[k]];
      measured[k] = camera.ray(o.x) * o.depth;
      mapped[k] = o.p_w;
    }
    // A rigid motion keeps lengths: most samples with a wrong match are seen through here.
    bool rigid = true;
    for (std::size_t a = 0; a < kSample && rigid; ++a) {
      const std::size_t b = (a + 1) % kSample;
      const S slack = std::sqrt(options.truncation) * (S(1) / std::sqrt(matches[sample[a]].inv_sigma_z2) +
                                                       S(1) / std::sqrt(matches[sample[b]].inv_sigma_z2));
      rigid = std::abs((measured[a] - measured[b]).norm() - (mapped[a] - mapped[b]).norm()) <= slack;
    }
    if (!rigid) continue;
    const auto T = horn_alignment<S>(mapped, measured);
    if (!T) continue;
    const auto motion = T->isometry();
    S cost = S(0);
    int inliers = 0;
    for (const PoseObservation<S>& o : matches) {
      const S e = std::min(options.truncation, observation_chi2(camera, motion, o));
      inliers += e < options.truncation ? 1 : 0;
      cost += e;
      if (cost >= best_cost) break;
    }
    if (cost >= best_cost) continue;
    best_cost = cost;
    best.found = true;
    best.T_c_w = *T;
    best.inliers = inliers;
    const S share = static_cast<S>(inliers) / static_cast<S>(matches.size());
    const S all_good = share * share * share;
    if (all_good >= S(1)) break;
    if (all_good > S(0)) {
      const S wanted = std::log(S(1) - options.confidence) / std::log(S(1) - all_good);
      if (wanted < static_cast<S>(needed)) needed = static_cast<int>(std::ceil(wanted));
    }
  }
  return best;
}

}  // namespace dynslam
