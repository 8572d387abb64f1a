// SPDX-License-Identifier: BSD-3-Clause
// Whose numerator is meant has to be said: nu + 1 or nu + d. EXPECT: TDistribution
#include "dynslam/robust/t_distribution.hpp"

#ifdef RIGHT
const auto kernel = dynslam::TDistribution<double>::with_dimension(5, 3);
#else
const dynslam::TDistribution<double> kernel(5);
#endif
