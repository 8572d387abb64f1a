// SPDX-License-Identifier: BSD-3-Clause
// Cameras of the TUM RGB-D benchmark, without their lenses.
#pragma once

#include "dynslam/geometry/pinhole.hpp"

namespace dynslam::test {

inline const Pinhole<double> kFreiburg1(517.306, 516.469, 318.643, 255.314);
inline const Pinhole<double> kFreiburg3(535.4, 539.2, 320.1, 247.6);

}  // namespace dynslam::test
