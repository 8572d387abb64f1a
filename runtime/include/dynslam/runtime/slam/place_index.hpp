// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/features/multi_index.hpp"

namespace dynslam::runtime {

using dynslam::PlaceIndex;

}  // namespace dynslam::runtime
