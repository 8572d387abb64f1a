// SPDX-License-Identifier: BSD-3-Clause
// One fault for the include scan: a header is missing here.
#pragma once
#include "dynslam/push_macros.hpp"
#include "dynslam/eval/trajectory.hpp"
#include "dynslam/pop_macros.hpp"
