// SPDX-License-Identifier: BSD-3-Clause
// Four faults for the include scan: macros, a stream, a library, a higher layer.
#pragma once
#include <cmath>
#include <iostream>
#  include <opencv2/core.hpp>
#include "dynslam/eval/trajectory.hpp"
