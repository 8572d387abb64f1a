// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstdint>

namespace dynslam {

/// What the mask of moving things rests on.
enum class MotionMethod : std::uint8_t {
  paper,  ///< the paper's steps 5 to 10 alone: regions grown around groups of dynamic keypoints
  full    ///< also the space that earlier frames saw to be free, and surfaces verified to be at rest
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
