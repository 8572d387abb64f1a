// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>

namespace dynslam::runtime::viewing {

/// Keeps work that grows with the run down to a share of a thread's time.
class WorkShare {
 public:
  /// @param pause  time between two pieces of work, as a multiple of the last one's
  explicit WorkShare(double pause) : pause_(pause) {}
  [[nodiscard]] bool due() const { return Clock::now() >= next_; }
  template <class Work>
  void spend(Work&& work) {
    const auto begin = Clock::now();
    work();
    const auto end = Clock::now();
    next_ = end + std::chrono::duration_cast<Clock::duration>(pause_ * (end - begin));
  }

 private:
  using Clock = std::chrono::steady_clock;
  double pause_;
  Clock::time_point next_{};
};

}  // namespace dynslam::runtime::viewing
