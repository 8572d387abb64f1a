// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace dynslam::app {

/// "dynslam 0.1.0 (0123456789ab)": the version and the commit that the program was made of, with "-dirty"
/// where there were changes beside it; the version alone where it was made of no repository.
[[nodiscard]] std::string program_and_commit();

}  // namespace dynslam::app
