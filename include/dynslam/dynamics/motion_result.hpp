// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <concepts>
#include <cstdint>
#include <vector>

#include "dynslam/dynamics/static_weights.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/image/image.hpp"

namespace dynslam {

/// Whether a frame was segmented.
enum class MotionStatus : std::uint8_t {
  ok,
  size_mismatch,  ///< an image of another size than the first one, or than its fellow: nothing was done
  /// A time that is not later than that of the frame last remembered, or not a number: nothing was done.
  /// Where the clock was set back, reset() begins anew.
  time_not_later,
  /// The keypoints of the reference keyframe agree on no pose, so no mask would be right, and none is given.
  pose_unsupported,
  /// Next to all of the view would be dynamic: the pose is wrong or something stands right before the camera.
  /// No mask is given.
  covers_view
};

/// A keypoint of the reference keyframe in the present frame, and the verdict on it.
template <std::floating_point S>
struct JudgedMatch {
  Eigen::Matrix<S, 2, 1> x, x_m;  ///< recorded pixels in the reference and in the present image
  S weight = S(1);                ///< Eq (7)
  bool dynamic = false;
};

/// What moves in a frame.
template <std::floating_point S>
struct MotionResult {
  MotionStatus status = MotionStatus::ok;
  Image<std::uint8_t> mask;      ///< 255 where something moves in the depth image, at its size
  Image<std::uint8_t> verified;  ///< cells whose surface was in the same place long before
  /// Empty where too few were found. Those off their epipolar curve are left out, or with MotionMethod::paper
  /// dynamic.
  std::vector<JudgedMatch<S>> matches;
  // How it came about.
  bool own_pose =
      false;  ///< the keypoints contradict the pose that was given: one of the segmenter's own was used
  /// The pose that the mask rests on: the one that was given, or the segmenter's own. A host that minimises
  /// from a start takes its start from here, or stays in the minimum into which what moves once pulled it.
  SE3<S> T_c_w;
  int tracked = 0;     ///< reference keypoints found
  int mismatches = 0;  ///< off their epipolar curve
  bool epipolar_used = false;
  int dynamic_matches = 0;
  StaticWeightScales<S> scales{};
  int seeds = 0;           ///< dynamic cells; with MotionMethod::paper those that started the growing
  int regions_leaked = 0;  ///< dropped by the guard of MotionMethod::paper
  [[nodiscard]] bool ok() const { return status == MotionStatus::ok; }
  /// Says of no pixel that it moves or rests.
  const MotionResult& refuse(MotionStatus why) {
    status = why;
    mask.fill(0);
    verified.fill(0);
    matches.clear();
    tracked = mismatches = dynamic_matches = seeds = regions_leaked = 0;
    epipolar_used = own_pose = false;
    scales = {};
    return *this;
  }
};

/// Parts of a frame's work, as they are reported to `segment`'s observer.
enum class MotionStage : std::uint8_t { matching, residuals, free_space, growing };

/// The observer that does not care.
struct IgnoreStages {
  void operator()(MotionStage) const {}
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
