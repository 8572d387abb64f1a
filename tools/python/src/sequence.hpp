// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/runtime/frame.hpp"

namespace dynslam::python {

/// A frame as Python has it: its images are never written again.
struct Frame {
  runtime::RgbdFrame frame;
};

}  // namespace dynslam::python
