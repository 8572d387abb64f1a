// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <type_traits>

#include "dynslam/optim/readout_measurement.hpp"
#include "dynslam/runtime/frame.hpp"
#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/masks.hpp"
#include "dynslam/runtime/slam/track_result.hpp"
#include "dynslam/runtime/slam/tracker_options.hpp"
#include "dynslam/runtime/slam/types.hpp"

namespace dynslam::runtime {

struct FrameState;  // of src/slam/, as are the tracker's parts

/// Frame-to-local-map RGB-D tracking with the paper's order of work per frame: initial pose from
/// points outside the a-priori mask, geometry against the reference keyframe, fused mask, second
/// optimisation on what is left.
class Tracker {
 public:
  Tracker(const CameraConfig& camera, const TrackerOptions& options);
  ~Tracker();
  Tracker(const Tracker&) = delete;
  Tracker& operator=(const Tracker&) = delete;

  /// Tracks the next frame. `prior` is the a-priori (semantic) mask, if there is one. The caller may use its
  /// images again afterwards: what is kept of them is copied. Frames are counted here; `input.index` plays no
  /// part.
  /// @throws InputError, with nothing changed: images or masks that are not of the camera's size or of
  /// another type
  ///         than RgbdFrame and Masks say, or a time that does not come after the frame's before
  TrackResult track(const RgbdFrame& input, const std::optional<Masks>& prior);

  /// Goes on in an earlier map: the camera is lost until it finds itself there. Call it before track().
  void load(LocalMap map);

  /// Takes in another tracker's map, whose world T_w_other places in this one's. @return id of its first
  /// keyframe here
  int adopt(const LocalMap& other, const SE3<double>& T_w_other);

  /// Uses what is still being adjusted. Call it at the end, before poses are read from the map.
  void finish();

  /// Has readout() measured by the frames from now on.
  void measure_readout();
  /// How much longer the rows take than the camera's readout_time says; empty where it is not measured.
  [[nodiscard]] const std::optional<ReadoutMeasurement<double>>& readout() const;

  [[nodiscard]] const LocalMap& map() const;
  /// Bundle adjustments that were used so far.
  [[nodiscard]] std::size_t adjustments() const;
  /// What the geometry found in the frame last tracked; null where the mode does not ask it. After a frame
  /// that was lost it is an earlier one's.
  [[nodiscard]] const MotionResult<double>* motion() const;

 private:
  struct Parts;

  // One frame, in the order of work.
  void extract(FrameState& now);
  void start_map(FrameState& now);
  /// Finds the pose as long as the camera is known.
  bool locate(FrameState& now);
  /// Finds it by all other means, plainest last.
  TrackingState locate_lost(FrameState& now);
  /// The first frame was placed as a camera at rest would have seen it. The second tells how it moved: the
  /// map begins anew, the rows where they belong. @return whether it did
  bool rebuild_initial_map(const FrameState& now);
  void lose();
  void find_dynamic(FrameState& now);
  void revise_last(FrameState& now);
  void accept(FrameState& now);
  void keep(FrameState& now);
  void remember(FrameState& now, const cv::Mat& moves);
  /// Waits for the bundle adjustment, if one was asked for, and uses it. @return the correction, see
  /// LastFrame::follow()
  SE3<double> apply_bundle();
  /// Moves what is stored relative to the newest keyframe.
  void follow(const SE3<double>& D);

  std::unique_ptr<Parts> parts_;
};
static_assert(!std::is_move_constructible_v<Tracker> && !std::is_move_assignable_v<Tracker>);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
