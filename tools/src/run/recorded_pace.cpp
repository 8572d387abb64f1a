// SPDX-License-Identifier: BSD-3-Clause
#include "run/recorded_pace.hpp"

#include <algorithm>
#include <thread>

namespace dynslam::runtime {

bool RecordedPace::wait(double t, const std::atomic<bool>& stop) {
  using Clock = std::chrono::steady_clock;
  using Seconds = std::chrono::duration<double>;
  const bool gap = first_ && t - before_ > longest_;
  if (gap && skipped_++ == 0) first_skipped_ = t - before_;
  if (!first_ || gap) {
    first_ = t;
    begin_ = Clock::now();
  }
  before_ = t;
  constexpr double kLook = 0.1;  // whether to stop [s]; recordings have long gaps
  while (!stop.load()) {
    const double left = (t - *first_) / speed_ - Seconds(Clock::now() - begin_).count();
    if (left <= 0) return true;
    std::this_thread::sleep_for(Seconds(std::min(left, kLook)));
  }
  return false;
}

}  // namespace dynslam::runtime
