// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>

#include "dynslam/runtime/slam/local_bundle.hpp"
#include "dynslam/runtime/slam/types.hpp"

namespace dynslam::runtime {

/// Options of BundleSchedule.
struct BundleScheduleOptions {
  int delay = 4;                    ///< frames after which an adjustment's result is waited for and used
  int loop_window = 60;             ///< keyframes adjusted after a loop
  int loop_delay = 12;              ///< frames after which that is waited for
  double redundant_keyframe = 0.9;  ///< of its points seen by three others: a keyframe goes
  int spare_keyframes = 5;          ///< newest keyframes, which never go
  DepthNoise<double> depth_noise{0.004, 0.008};
};

/// When bundle adjustments of the map start and are used: at fixed frames, however busy the machine is.
/// Keyframes that are redundant then go.
class BundleSchedule {
 public:
  BundleSchedule(const Pinhole<double>& camera, const LocalBundleOptions& bundle,
                 const BundleScheduleOptions& options)
      : options_(options), bundle_(camera, bundle) {}

  /// Asks for an adjustment around the newest keyframe. It starts as soon as that is as it stays, at start().
  /// @param frame  index of the frame that it was made of
  void request(std::size_t frame, bool after_loop);
  void start(const LocalMap& map);
  /// Whether the result is to be used before a frame is tracked.
  [[nodiscard]] bool due(std::size_t frame) const { return frame >= due_; }
  /// Waits for the adjustment that was asked for, and uses it.
  /// @return the correction D: new T_c_w = old T_c_w D of what is stored relative to the newest keyframe;
  /// empty: there was none
  std::optional<SE3<double>> apply(LocalMap& map, PlaceIndex& places);
  /// That were used so far.
  [[nodiscard]] std::size_t adjustments() const { return adjustments_; }

 private:
  BundleScheduleOptions options_;
  LocalBundle bundle_;
  std::size_t due_ = 0;               // frame index
  std::optional<int> wanted_window_;  // of the adjustment that was asked for and has not started
  std::size_t adjustments_ = 0;
};

}  // namespace dynslam::runtime
