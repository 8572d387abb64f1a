// SPDX-License-Identifier: BSD-3-Clause
#include "commit.hpp"

#include "dynslam_commit.hpp"

namespace dynslam::app {

std::string program_and_commit() {
  const std::string commit = DYNSLAM_COMMIT;
  return "dynslam " DYNSLAM_VERSION + (commit.empty() ? commit : " (" + commit + ")");
}

}  // namespace dynslam::app
