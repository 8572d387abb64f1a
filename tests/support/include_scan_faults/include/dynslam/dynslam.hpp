// SPDX-License-Identifier: BSD-3-Clause
// One fault for the include scan: a header is missing here.
#pragma once
#include "dynslam/eval/trajectory.hpp"
