// SPDX-License-Identifier: BSD-3-Clause
// Two faults for the include scan: a header that does not exist, an interop header.
#pragma once
#include "dynslam/push_macros.hpp"
#include <Eigen/Core>

#include <dynslam/concepts/absent.hpp>
#include <dynslam/interop/opencv.hpp>
#include <dynslam/image/faulty.hpp>
#include "dynslam/pop_macros.hpp"
