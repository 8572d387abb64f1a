// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "dynslam/eval/trajectory.hpp"
#include "dynslam/optim/trajectory_smoothing.hpp"
#include "dynslam/runtime/frame.hpp"
#include "dynslam/runtime/slam/track_result.hpp"

namespace dynslam::runtime {

/// The frames that were tracked, each beside its keyframe.
class FramePoses {
 public:
  void add(const RgbdFrame& frame, const TrackResult& result);
  /// Takes in those of a map whose keyframes have become those from `first_keyframe` on.
  void take(const FramePoses& other, int first_keyframe);
  [[nodiscard]] std::vector<StampedPose<double>> poses(const LocalMap& map, bool keyframes_alone) const;
  /// Those of all frames, smoothed.
  [[nodiscard]] std::vector<StampedPose<double>> smoothed(const LocalMap& map,
                                                          const SmoothingOptions& options) const;
  /// T_w_c of the frame of time t [s] as the map has it now; nullopt: it was not tracked.
  [[nodiscard]] std::optional<SE3<double>> pose_at(double t, const LocalMap& map) const;
  [[nodiscard]] std::size_t size() const { return frames_.size(); }

 private:
  struct FramePose {
    double t;
    std::int64_t ns;
    int reference;
    SE3<double> T_c_reference;
    bool keyframe, relocalised;
    Eigen::Matrix<float, 6, 3> covariance;  // of the left increment, its columns of the translation
    int world = 0;                          // in which it was tracked: 0 this one, else one taken in
  };
  [[nodiscard]] static SE3<double> T_c_w(const FramePose& frame, const LocalMap& map);
  std::vector<FramePose> frames_;
  int taken_ = 0;
};

}  // namespace dynslam::runtime
