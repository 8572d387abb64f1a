// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "dynslam/optim/image_alignment.hpp"
#include "dynslam/optim/pose_consensus.hpp"
#include "dynslam/track/local_map_pose.hpp"

namespace dynslam {

/// A frame whose pose is searched.
template <std::floating_point S>
struct SearchedFrame : PoseEstimate<S> {
  bool plain = false;  ///< searched as a paper's: all matches alike, no motion prior, no alignment
  std::optional<ImageAlignmentResult<S>> aligned;  ///< with the last frame; empty: not tried
};

/// Finds the pose of a frame while the camera is known: from the last frame's points, where these are few
/// from its grey values, and proves it on the local map.
/// @tparam C  the camera as recorded
template <DifferentiableCamera C>
  requires std::floating_point<typename C::ScalarType>
class PoseSearch {
 public:
  using S = typename C::ScalarType;

  /// @param seed  of the consensus; a frame's index is added
  PoseSearch(const PoseTrackingOptions<S>& options, std::uint64_t seed) : options_(options), seed_(seed) {}

  /// @param align    align(T_now_last predicted): the motion since the last frame by its grey values, an
  ///                 ImageAlignmentResult
  /// @param started  started(): called when the last frame's points have been tried
  /// @return whether there is a pose: now.frame.T_c_w
  template <class E, class Align, class Started>
  bool locate(const E& from, LocalMapPose<C>& solver, Align&& align, Started&& started,
              SearchedFrame<S>& now) {
    return locate_by_features(from, solver, align, started, now) ||
           (!now.plain && locate_by_alignment(from, solver, align, options_.weak_inliers, now));
  }

  /// From the last frame's grey values alone. @return whether `required` points of the local map fit it
  template <class E, class Align>
  bool locate_by_alignment(const E& from, LocalMapPose<C>& solver, Align&& align, int required,
                           SearchedFrame<S>& now) {
    if (!start_by_alignment(from, solver, align, now) ||
        !refine(from, solver, required, now, kAlignedStrictFrom))
      return false;
    solver.add_to_readout(from, now);
    return true;
  }

  /// Whether matches that are far off are kept out where `now` is optimised.
  [[nodiscard]] bool strict(const SearchedFrame<S>& now) const {
    return options_.strict_local_map && !now.plain;
  }

 private:
  /// Of a start by grey values: they are compared in images of some 200 columns, good to some pixels.
  static constexpr int kAlignedStrictFrom = 1;

  /// @param strict_from  see LocalMapPose::refine(), where far matches are kept out at all
  template <class E>
  bool refine(const E& from, LocalMapPose<C>& solver, int required, SearchedFrame<S>& now,
              int strict_from = 0) const {
    return solver.refine(from, required, strict(now) ? strict_from : options_.settling_passes, now);
  }

  template <class E, class Align, class Started>
  bool locate_by_features(const E& from, LocalMapPose<C>& solver, Align& align, Started& started,
                          SearchedFrame<S>& now) {
    const PoseTrackingOptions<S>& o = options_;
    if (from.last.lost_frames() >= o.coasting_frames) return false;
    const SE3<S> predicted = from.last.predicted_pose();
    // The best of the weak starts is taken, the one by the last frame's grey values among them.
    std::optional<typename LocalMapPose<C>::Attempt> best;
    for (const float radius : {o.near_radius, o.far_radius}) {
      if (!start_by_features(from, solver, predicted, radius, now)) continue;
      if (now.inliers >= o.min_inliers) {
        started();
        const bool poor = now.inliers < o.sure_inliers;
        if (!(poor ? refine(from, solver, o.min_inliers, now)
                   : solver.prove(from, o.min_inliers, strict(now), now)))
          return false;
        solver.add_to_readout(from, now);
        return true;
      }
      const auto start = solver.save(now);
      if (refine(from, solver, 2 * o.min_inliers, now) && (!best || now.inliers > best->estimate.inliers))
        best = solver.save(now);
      solver.restore(from, start, now);
    }
    started();
    if (!best) return false;
    const bool aligned = !now.plain && start_by_alignment(from, solver, align, now) &&
                         refine(from, solver, 2 * o.min_inliers, now, kAlignedStrictFrom) &&
                         now.inliers > best->estimate.inliers;
    if (aligned) {
      solver.add_to_readout(from, now);
    } else {
      solver.restore(from, *best, now);
    }
    return true;
  }

  /// The pose that most of the last frame's points agree on, each looked for near where it is predicted.
  template <class E>
  bool start_by_features(const E& from, LocalMapPose<C>& solver, const SE3<S>& predicted, float radius,
                         SearchedFrame<S>& now) {
    const PoseTrackingOptions<S>& o = options_;
    MatchedPose<S>& optimiser = solver.optimiser();
    const FeatureFrame<S>& last = from.last.frame();
    optimiser.set_rows_known();  // as predicted, until the local map tells
    if (solver.matcher().match_last(from.map, last, predicted, radius, now.frame) < o.weak_inliers)
      return false;
    solver.matcher().refine(from.map, predicted, from.pyramid, from.depth, now.frame);
    optimiser.gather(from.map, now.frame);
    PoseConsensusOptions<S> consensus;
    consensus.seed = seed_ + now.frame.index;
    const Eigen::Vector2i image_size(solver.placer().width(), solver.placer().height());
    if (!now.plain) {
      const auto interval = static_cast<S>(std::max(1e-3, from.time.t - last.t));
      consensus.prior_share = o.prior_share;
      consensus.prior_translation = o.prior_speed * interval;
      consensus.prior_rotation = o.prior_turn * interval;
    }
    const SE3<S> start = optimiser.consensus(predicted, std::span<const SE3<S>>(&last.T_c_w, 1), consensus,
                                             o.surface_weights && !now.plain ? &image_size : nullptr);
    optimiser.keep_consistent(start, consensus.truncation, now.frame);
    const PoseResult<S> pose = optimiser.optimize(from.map, start, now.frame);
    if (pose.inliers < o.weak_inliers) return false;
    now.frame.T_c_w = pose.T_c_w;
    now.inliers = pose.inliers;
    return true;
  }

  /// A pose by the last frame's grey values, as a start where its points do not tell. @return whether there
  /// is one
  template <class E, class Align>
  bool start_by_alignment(const E& from, LocalMapPose<C>& solver, Align& align, SearchedFrame<S>& now) const {
    if (!options_.aligned_starts || from.last.lost_frames() >= options_.coasting_frames) return false;
    if (!now.aligned) now.aligned = align(from.last.predicted_motion());
    if (!now.aligned->ok()) return false;
    const SE3<S> T_c_w = now.aligned->T_image_reference * from.last.frame().T_c_w;
    if (!from.last.reachable(T_c_w, now.frame.t)) return false;  // a dynamic object fills the view
    now.plain = false;  // from a good start what moves can be told from what is static
    solver.matcher().clear(now.frame);
    now.frame.T_c_w = T_c_w;
    return true;
  }

  PoseTrackingOptions<S> options_;
  std::uint64_t seed_;
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
