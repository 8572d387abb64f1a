// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <chrono>
#include <optional>

namespace dynslam::runtime {

/// Plays a recording at the pace of its time stamps.
class RecordedPace {
 public:
  /// @param speed  2: twice as fast
  explicit RecordedPace(double speed) : speed_(speed) {}

  /// Waits until a frame is due; the first one is at once. @return false where `stop` became true first
  bool wait(double t, const std::atomic<bool>& stop);

 private:
  double speed_;
  std::optional<double> first_;  // time of the first frame [s]
  std::chrono::steady_clock::time_point begin_;
};

}  // namespace dynslam::runtime
