// SPDX-License-Identifier: BSD-3-Clause
// No fault.
#pragma once
#include <opencv2/core.hpp>

#include <dynslam/image/faulty.hpp>
