// SPDX-License-Identifier: BSD-3-Clause
// Internal to the evaluation.
#pragma once

#include <optional>
#include <span>

#include "dynslam/eval/trajectory.hpp"

namespace dynslam::runtime {

struct ClockOffset {
  double seconds = 0;    ///< to add to the estimate's times
  double deviation = 0;  ///< standard deviation of it [s]
};

/// What to add to an estimate's times so that it turns and moves when the ground truth does, whatever the two
/// clocks say and however the two are aligned. nullopt where neither tells to 0.02 s.
[[nodiscard]] std::optional<ClockOffset> clock_offset(std::span<const StampedPose<double>> estimate,
                                                      std::span<const StampedPose<double>> groundtruth);

}  // namespace dynslam::runtime
