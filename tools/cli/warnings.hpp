// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <iostream>
#include <string>
#include <vector>

namespace dynslam::app {

/// A line on stderr for each.
inline void warn(const std::vector<std::string>& lines) {
  for (const std::string& line : lines) std::cerr << "dynslam: warning: " << line << '\n';
}

}  // namespace dynslam::app
