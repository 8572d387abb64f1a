// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace dynslam::runtime {

/// Memory of this process that is in RAM now [MB]; 0 where the system does not tell (no /proc).
[[nodiscard]] double rss_mb();

/// The most that it was so far [MB].
[[nodiscard]] double peak_rss_mb();

}  // namespace dynslam::runtime
