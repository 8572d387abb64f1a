// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <chrono>

namespace dynslam::runtime {

/// Steady-clock stopwatch.
class Stopwatch {
 public:
  /// Milliseconds since construction or the last lap; starts the next lap.
  double lap_ms() {
    const auto now = Clock::now();
    const std::chrono::duration<double, std::milli> lap = now - start_;
    start_ = now;
    return lap.count();
  }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now();
};

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
