// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <type_traits>
#include <vector>

#include "dynslam/geometry/se3.hpp"
#include "dynslam/optim/pose_residual.hpp"
#include "dynslam/optim/pose_step.hpp"
#include "dynslam/optim/surface_weights.hpp"
#include "dynslam/optim/truncated_cost.hpp"
#include "dynslam/robust/consensus.hpp"

namespace dynslam {

/// Options of pose_consensus.
template <Scalar S>
struct PoseConsensusOptions {
  int hypotheses = 120;  ///< minimal samples that are tried
  S confidence = S(0);  ///< above 0: fewer, once one without an outlier was among them with this probability.
                        ///< All are tried by default: where several motions compete, the first good one may
                        ///< be a mover's
  int iterations = 3;   ///< Gauss-Newton steps per sample, and per refinement
  S truncation = S(6);  ///< squared normalised error beyond which an observation counts as an outlier
  std::uint64_t seed = 1;  ///< same seed, same result
  // How far from its prediction a pose is likely to be. Where little is seen, some samples of it fit any
  // motion.
  S prior_share = S(0);           ///< the prediction counts as this share of all observations; 0: not at all
  S prior_translation = S(0.03);  ///< standard deviation [m]
  S prior_rotation = S(0.03);     ///< standard deviation [rad]
};

/// How pose_consensus ended.
enum class PoseConsensusStatus : std::uint8_t {
  found,
  too_few_observations,  ///< fewer than three: the prediction and its alternatives were compared alone
  bad_input              ///< weights of another number than the observations, or not finite and >= 0
};

/// The motion that most observations agree on.
template <Scalar S>
struct PoseConsensusResult {
  PoseConsensusStatus status = PoseConsensusStatus::too_few_observations;
  SE3<S> T_c_w;  ///< the prediction on failure, unless an alternative is better
  S cost = std::numeric_limits<S>::infinity();  ///< weighted sum of truncated squared normalised errors
  int inliers = 0;                              ///< observations below the truncation
  int hypotheses = 0;                           ///< tried
  [[nodiscard]] bool ok() const { return status == PoseConsensusStatus::found; }
};

/// Memory and per-observation output of pose_consensus; keep it between calls to avoid allocation.
struct PoseConsensusWorkspace {
  std::vector<std::uint8_t> inlier;  ///< out: 1 = below the truncation at the result
};

namespace detail {

template <std::floating_point S, class Camera>
class PoseConsensusSearch {
 public:
  static constexpr std::size_t kSample = 3;  // with depth, three points determine a pose

  PoseConsensusSearch(const Camera& camera, std::span<const PoseObservation<S>> observations,
                      std::span<const S> weights, const SE3<S>& T_c_w_predicted,
                      const PoseConsensusOptions<S>& options, PoseConsensusResult<S>& best)
      : camera_(camera),
        observations_(observations),
        weights_(weights),
        predicted_(T_c_w_predicted),
        T_w_predicted_(T_c_w_predicted.inverse()),
        options_(options),
        best_(best) {
    for (std::size_t k = 0; k < observations_.size(); ++k) prior_weight_ += options_.prior_share * weight(k);
    if (!weights_.empty()) heaviest_ = *std::max_element(weights_.begin(), weights_.end());
  }

  /// Makes a pose the best one if it is. @return whether it is
  bool judge(const SE3<S>& T) {
    const S prior =
        prior_weight_ > S(0) ? prior_weight_ * std::min(options_.truncation, prior_chi2(T)) : S(0);
    const auto sum = truncated_cost<S>(
        camera_, T, observations_, options_.truncation, [this](std::size_t k) { return weight(k); }, prior,
        best_.cost);
    if (!sum) return false;
    best_.T_c_w = T;
    best_.cost = sum->cost;
    best_.inliers = sum->inliers;
    return true;
  }

  /// Proposes the poses of random samples, and refines each that is better than all before.
  /// @return samples tried
  int sample() {
    SamplingOptions<S> sampling{options_.hypotheses, options_.confidence, options_.seed};
    if (options_.confidence > S(0)) {  // the prediction and its alternatives count as samples, too
      sampling.max_iterations = samples_needed<kSample>(share(), options_.confidence, options_.hypotheses);
    }
    return sample_consensus<kSample, S>(
        sampling,
        [this](SplitMix64& random, Sample& sample) {
          draw_distinct([&] { return draw_observation(random); }, sample);
          return true;
        },
        [this](const Sample& sample, const auto& consider) {
          if (const auto T = pose_of(sample)) consider(*T);
        },
        [this](const SE3<S>& T) -> std::optional<S> {
          if (!judge(T)) return std::nullopt;
          refine();
          return share();
        });
  }

 private:
  using Sample = std::array<std::size_t, kSample>;

  /// The pose of a sample, from the predicted one; nullopt where it determines none.
  [[nodiscard]] std::optional<SE3<S>> pose_of(const Sample& sample) {
    SE3<S> T = predicted_;
    for (int i = 0; i < options_.iterations; ++i) {
      step_.set_zero();
      const auto motion = T.isometry();
      for (const std::size_t k : sample) {
        if (!step_.add(camera_, observations_[k], motion, std::numeric_limits<S>::infinity()))
          return std::nullopt;
      }
      const auto next = step_.from(T);
      if (!next) return std::nullopt;
      T = *next;
    }
    return T;
  }

  /// Of the observations, within the best pose's inliers.
  [[nodiscard]] S share() const {
    return static_cast<S>(best_.inliers) / static_cast<S>(observations_.size());
  }
  [[nodiscard]] S weight(std::size_t k) const { return weights_.empty() ? S(1) : weights_[k]; }
  [[nodiscard]] S prior_chi2(const SE3<S>& T) const {
    const SE3<S> step = T * T_w_predicted_;
    return step.translation().squaredNorm() / (options_.prior_translation * options_.prior_translation) +
           step.so3().log().squaredNorm() / (options_.prior_rotation * options_.prior_rotation);
  }

  /// Improves the best pose on what agrees with it.
  void refine() {
    for (int i = 0; i < options_.iterations; ++i) {
      const auto next = step_.from(camera_, best_.T_c_w, observations_, options_.truncation);
      if (!next || !judge(*next)) return;
    }
  }

  /// By weight.
  [[nodiscard]] std::size_t draw_observation(SplitMix64& random) const {
    constexpr int kRefusals = 1000;  // weights that differ by more than this are no longer told apart
    std::size_t k = 0;
    for (int trial = 0; trial < kRefusals; ++trial) {
      k = random.index(observations_.size());
      if (weights_.empty() || random.template unit<S>() * heaviest_ < weights_[k]) break;
    }
    return k;
  }

  const Camera& camera_;
  std::span<const PoseObservation<S>> observations_;
  std::span<const S> weights_;
  const SE3<S>& predicted_;
  SE3<S> T_w_predicted_;
  const PoseConsensusOptions<S>& options_;
  PoseConsensusResult<S>& best_;
  S prior_weight_ = S(0), heaviest_ = S(1);
  PoseStep<S, Camera> step_;
};

}  // namespace detail

/// The pose that most observations agree on, where several rigid motions compete (people and things
/// that move before a static scene).
///
/// A robust kernel on all observations finds a compromise: the rotation that nearly follows a distant
/// background can be traded for the translation that follows a near mover. Here poses are proposed by
/// small samples, refined from the predicted pose, and compared by a truncated cost with the pixel
/// accuracy of a true match (MSAC, Torr and Zisserman 2000), in which a mover costs the same however
/// far it has gone. Each new best pose is refined on what agrees with it (LO-RANSAC, Chum et al. 2003).
/// `T_c_w_predicted` and `alternatives` compete, too.
/// @param camera  any camera with a derivative; the observations are its pixels
/// @param observations  reprojection and depth, as for optimize_pose
/// @param weights  per observation, >= 0; empty: all equal. An observation is sampled and counts by its
///                 weight. See surface_weights().
template <std::floating_point S, DifferentiableCameraOf<S> Camera>
[[nodiscard]] PoseConsensusResult<S> pose_consensus(
    const Camera& camera, std::span<const PoseObservation<std::type_identity_t<S>>> observations,
    std::span<const std::type_identity_t<S>> weights, const SE3<S>& T_c_w_predicted,
    std::span<const SE3<std::type_identity_t<S>>> alternatives, const PoseConsensusOptions<S>& options,
    PoseConsensusWorkspace& workspace) {
  PoseConsensusResult<S> best;
  best.T_c_w = T_c_w_predicted;
  workspace.inlier.assign(observations.size(), 0);
  const auto usable = [](S w) { return w >= S(0) && w <= std::numeric_limits<S>::max(); };
  if ((!weights.empty() && weights.size() != observations.size()) ||
      !std::all_of(weights.begin(), weights.end(), usable)) {
    best.status = PoseConsensusStatus::bad_input;
    return best;
  }
  detail::PoseConsensusSearch<S, Camera> search(camera, observations, weights, T_c_w_predicted, options,
                                                best);
  search.judge(T_c_w_predicted);
  for (const SE3<S>& T : alternatives) search.judge(T);
  if (observations.size() >= search.kSample) {
    best.status = PoseConsensusStatus::found;
    best.hypotheses = search.sample();
  }
  const auto motion = best.T_c_w.isometry();
  for (std::size_t k = 0; k < observations.size(); ++k) {
    workspace.inlier[k] = observation_chi2(camera, motion, observations[k]) < options.truncation ? 1 : 0;
  }
  return best;
}

/// The same for those who try it once: no weights, memory of its own.
template <std::floating_point S, DifferentiableCameraOf<S> Camera>
[[nodiscard]] PoseConsensusResult<S> pose_consensus(
    const Camera& camera, std::span<const PoseObservation<std::type_identity_t<S>>> observations,
    const SE3<S>& T_c_w_predicted, const PoseConsensusOptions<S>& options = {}) {
  PoseConsensusWorkspace workspace;
  return pose_consensus<S>(camera, observations, {}, T_c_w_predicted, {}, options, workspace);
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
