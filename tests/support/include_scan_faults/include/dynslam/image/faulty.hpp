// SPDX-License-Identifier: BSD-3-Clause
// Three faults for the include scan: a stream, a library, a higher layer.
#pragma once
#include <cmath>
#include <iostream>
#  include <opencv2/core.hpp>
#include "dynslam/eval/trajectory.hpp"
