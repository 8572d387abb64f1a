// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numeric>
#include <optional>
#include <span>
#include <vector>

#include "dynslam/geometry/p3p.hpp"
#include "dynslam/geometry/rigid_alignment.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/optim/pose_residual.hpp"
#include "dynslam/optim/pose_step.hpp"
#include "dynslam/optim/truncated_cost.hpp"
#include "dynslam/robust/consensus.hpp"

namespace dynslam {

/// Options of absolute_pose.
template <Scalar S>
struct AbsolutePoseOptions {
  int hypotheses = 300;     ///< minimal samples at most; fewer once the best one's inliers allow it
  S confidence = S(0.999);  ///< that a sample without an outlier was among them
  S truncation = S(16);     ///< squared normalised error beyond which an observation counts as an outlier
  int refinements = 3;  ///< Gauss-Newton steps of each new best pose on its inliers, while that gains some;
                        ///< of cameras with a derivative
  /// Where fewer than this share of the observations have depth, or fewer than three, samples are pixels
  /// alone: few points in one corner would decide for all.
  S min_depth_share = S(0.25);
  std::uint64_t seed = 1;  ///< same seed, same result
};

/// How the search for an absolute pose ended.
enum class AbsolutePoseStatus : std::uint8_t {
  found,
  too_few_observations,  ///< fewer than three
  no_consensus           ///< no sample gave a pose
};

/// A pose found without a start value, and how well it fits.
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
  std::vector<std::size_t> sampled;  // observations that samples are drawn from
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

/// The poses of three observations without depth (P3P).
template <std::floating_point S, class Camera, class Consider>
void poses_of_pixels(const Camera& camera, std::span<const PoseObservation<S>> observations,
                     const std::array<std::size_t, 3>& sample, const Consider& consider) {
  Eigen::Matrix3d rays, points;
  for (std::size_t k = 0; k < sample.size(); ++k) {
    const PoseObservation<S>& o = observations[sample[k]];
    const auto p = camera.unproject(o.x, S(1));
    if (!p) return;
    rays.col(static_cast<Eigen::Index>(k)) = p->template cast<double>().normalized();
    points.col(static_cast<Eigen::Index>(k)) = o.p_w.template cast<double>();
  }
  std::array<SE3<double>, 4> poses;
  const int n = perspective_three_point(rays, points, poses);
  for (int k = 0; k < n; ++k) consider(poses[static_cast<std::size_t>(k)].template cast<S>());
}

/// The observations that samples are drawn from: those with depth if they are many enough, or all.
/// @return whether they have depth
template <std::floating_point S>
[[nodiscard]] bool choose_sampled(std::span<const PoseObservation<S>> observations, S min_depth_share,
                                  std::vector<std::size_t>& sampled) {
  sampled.clear();
  for (std::size_t k = 0; k < observations.size(); ++k) {
    if (measures_depth(observations[k])) sampled.push_back(k);
  }
  if (sampled.size() >= 3 &&
      static_cast<S>(sampled.size()) >= min_depth_share * static_cast<S>(observations.size()))
    return true;
  sampled.resize(observations.size());
  std::iota(sampled.begin(), sampled.end(), std::size_t(0));
  return false;
}

}  // namespace detail

/// The pose from observations of map points alone, without a guess (relocalisation, loop closing), where
/// most matches may be wrong: three with depth give a pose by Horn's alignment of the measured
/// points with the map's, three without up to four (P3P), and the one with the least truncated reprojection
/// and depth cost wins (MSAC), each new best one refined on what agrees with it (LO-RANSAC, Chum et al.
/// 2003). It is a start for optimize_pose, not its replacement: the cost of an outlier is truncated, and
/// inliers count alike however near the bound they are.
/// @param camera  any camera, for the refinement one with a derivative; the observations are its pixels
/// @param observations  with depth or without; min_depth_share says which are sampled
template <std::floating_point S, CameraOf<S> Camera>
[[nodiscard]] AbsolutePoseResult<S> absolute_pose(const Camera& camera,
                                                  std::span<const PoseObservation<S>> observations,
                                                  const AbsolutePoseOptions<S>& options,
                                                  AbsolutePoseWorkspace& workspace) {
  AbsolutePoseResult<S> best;
  const bool depth = detail::choose_sampled(observations, options.min_depth_share, workspace.sampled);
  const std::size_t n = workspace.sampled.size();
  if (n < 3) return best;
  best.status = AbsolutePoseStatus::no_consensus;
  const auto judge = [&](const SE3<S>& T) {
    const auto sum = truncated_cost<S>(
        camera, T, observations, options.truncation, [](std::size_t) { return S(1); }, S(0), best.cost);
    if (!sum) return false;
    best.status = AbsolutePoseStatus::found;
    best.cost = sum->cost;
    best.T_c_w = T;
    best.inliers = sum->inliers;
    return true;
  };
  const auto refine = [&] {
    if constexpr (DifferentiableCameraOf<Camera, S>) {
      detail::PoseStep<S, Camera> step;
      for (int i = 0; i < options.refinements && best.inliers > 3; ++i) {
        const auto next = step.from(camera, best.T_c_w, observations, options.truncation);
        if (!next || !judge(*next)) return;
      }
    }
  };
  const SamplingOptions<S> sampling{options.hypotheses, options.confidence, options.seed};
  best.hypotheses = sample_consensus<3, S>(
      sampling,
      [&](SplitMix64& random, std::array<std::size_t, 3>& sample) {
        for (std::size_t& k : sample) k = workspace.sampled[random.index(n)];
        return sample[0] != sample[1] && sample[0] != sample[2] && sample[1] != sample[2];
      },
      [&](const std::array<std::size_t, 3>& sample, const auto& consider) {
        if (!depth) {
          detail::poses_of_pixels<S>(camera, observations, sample, consider);
        } else if (const auto T =
                       detail::pose_of_sample<S>(camera, observations, sample, options.truncation)) {
          consider(*T);
        }
      },
      [&](const SE3<S>& T) -> std::optional<S> {
        if (!judge(T)) return std::nullopt;
        refine();
        return static_cast<S>(best.inliers) / static_cast<S>(observations.size());
      });
  refine();
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

#include "dynslam/pop_macros.hpp"
