// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <optional>

namespace dynslam::runtime {

/// Plays a recording at the pace of its time stamps.
class RecordedPace {
 public:
  /// @param speed    2: twice as fast
  /// @param longest  time between two frames that is waited for; after a longer one a frame comes at once [s]
  RecordedPace(double speed, double longest) : speed_(speed), longest_(longest) {}

  /// Waits until a frame is due; the first one is at once. @return false where `stop` became true first
  bool wait(double t, const std::atomic<bool>& stop);
  /// Gaps that were not waited for so far, and the first of them [s].
  [[nodiscard]] std::size_t skipped() const { return skipped_; }
  [[nodiscard]] double first_skipped() const { return first_skipped_; }

 private:
  double speed_, longest_;
  std::optional<double> first_;  // time of the first frame, or of the one behind a gap [s]
  double before_ = 0;            // of the last frame [s]
  std::size_t skipped_ = 0;
  double first_skipped_ = 0;
  std::chrono::steady_clock::time_point begin_;
};

}  // namespace dynslam::runtime
