// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <limits>
#include <numeric>
#include <span>
#include <vector>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/concepts/image.hpp"
#include "dynslam/dynamics/locate_reference.hpp"
#include "dynslam/dynamics/residual_batch.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/optim/truncated_cost.hpp"

namespace dynslam {

/// When MotionSegmenter believes the pose that it is given.
struct PoseCheckOptions {
  /// Whether it asks. Not for hosts that know what moves before they give a pose.
  bool use = true;
  /// Of what the best pose explains of the reference keyframe's surface, the share that the host's must
  /// explain, too.
  double agreement = 0.5;
  /// Share of that surface that the best pose must explain for a mask to be given.
  double least = 0.1;
  /// Share of the measured view beyond which no mask is given.
  double most = 0.8;
};

/// Checks a host's poses against the keypoints of a reference keyframe. What moves pulls at a host's pose,
/// and a pulled pose makes the room move: of a pose that the keypoints contradict only the motion since the
/// last frame is used, as the start of a search for one that they agree on (locate_reference()).
template <std::floating_point S>
class PoseCheck {
 public:
  struct Result {
    SE3<S> T_c_w;           ///< to be used in place of the host's
    bool host = true;       ///< it is the host's
    bool supported = true;  ///< enough of the keypoints agree with it
  };

  /// @param matches  of the reference keyframe, found with the host's pose
  /// @param T_c_w    the host's pose
  template <DifferentiableCameraOf<S> Camera, DepthImage D>
  Result check(const Camera& camera, std::span<const KeypointMatch<S>> matches, const SE3<S>& T_ref_w,
               const D& depth, const SE3<S>& T_c_w, const LocateOptions<S>& locating,
               const PoseCheckOptions& options) {
    const SE3<S> followed = T_c_w * T_host_own_;
    detail::observe_reference(matches, T_ref_w, depth, followed, locating, workspace_);
    const S all = std::accumulate(workspace_.weights.begin(), workspace_.weights.end(), S(0));
    if (!(all > S(0))) return {T_c_w};
    const auto explained = [&](const SE3<S>& T) {
      const auto cost = truncated_cost<S>(
          camera, T, std::span<const PoseObservation<S>>(workspace_.observations),
          locating.consensus.truncation, [&](std::size_t k) { return workspace_.weights[k]; }, S(0),
          std::numeric_limits<S>::max());
      return cost ? S(1) - cost->cost / (all * locating.consensus.truncation) : S(0);
    };
    const S by_host = explained(T_c_w);
    if (by_host >= S(std::max(options.agreement, options.least))) {  // no pose explains more than all
      T_host_own_ = SE3<S>();
      return {T_c_w};
    }
    const auto located = detail::locate_observed(camera, followed, locating, workspace_);
    const S best = explained(located.T_c_w);
    const bool supported = best >= S(options.least);
    const S needed = S(options.agreement) * best;
    if (by_host >= needed) {
      T_host_own_ = SE3<S>();
      return {T_c_w, true, supported};
    }
    if (explained(followed) >= needed) return {followed, false, supported};
    T_host_own_ = T_c_w.inverse() * located.T_c_w;
    return {located.T_c_w, false, supported};
  }

  /// The host's world was moved: new T_c_w = old T_c_w D.
  void follow(const SE3<S>& D) { T_host_own_ = D.inverse() * T_host_own_ * D; }
  void clear() { T_host_own_ = SE3<S>(); }

 private:
  SE3<S> T_host_own_;  // from the world in which the keypoints agree to the host's
  LocateWorkspace<S> workspace_;
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
