// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace dynslam::app {

inline constexpr int kInputFailure = 1, kUsageFailure = 2, kInterrupted = 130;

}  // namespace dynslam::app
