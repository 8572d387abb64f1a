// SPDX-License-Identifier: BSD-3-Clause
// Cameras of the TUM RGB-D benchmark, without their lenses.
#pragma once

#include "dynslam/geometry/pinhole.hpp"

namespace dynslam::test {

// Not inline: a test's own constants that are made of these would be made before them, or not, as the linker
// likes.
const Pinhole<double> kFreiburg1(517.306, 516.469, 318.643, 255.314);
const Pinhole<double> kFreiburg3(535.4, 539.2, 320.1, 247.6);

}  // namespace dynslam::test
