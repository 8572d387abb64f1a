// SPDX-License-Identifier: BSD-3-Clause
// No fault.
#pragma once
#include "dynslam/push_macros.hpp"
#include <opencv2/core.hpp>

#include <dynslam/image/faulty.hpp>
#include "dynslam/pop_macros.hpp"
