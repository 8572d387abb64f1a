// SPDX-License-Identifier: BSD-3-Clause
// Pixels are numbers with fractions: a camera of integers would truncate them. EXPECT: Scalar
#include "dynslam/geometry/pinhole.hpp"

#ifdef RIGHT
dynslam::Pinhole<float> camera(525, 525, 320, 240);
#else
dynslam::Pinhole<int> camera(525, 525, 320, 240);
#endif
