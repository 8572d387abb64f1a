// SPDX-License-Identifier: BSD-3-Clause
// Readers know neither tracking nor what runs sequences; three lines are right.
#include <vector>

#include "dynslam/geometry/se3.hpp"
#include "dynslam/runtime/frame.hpp"
#include "dynslam/runtime/slam.hpp"
#include "io/other.hpp"
#include "run/run_request.hpp"
