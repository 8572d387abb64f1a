// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

namespace dynslam {

/// Which pixels are neighbours: those that share an edge, or those that share a corner, too. A region and the
/// background around it must differ in it, or a diagonal line both separates and does not.
enum class Connectivity { four = 4, eight = 8 };

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
