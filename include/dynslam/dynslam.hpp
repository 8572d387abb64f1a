// SPDX-License-Identifier: BSD-3-Clause
#pragma once

/// All headers of the core. The adapters for OpenCV and OctoMap (dynslam/interop/) are included on their own.
#include "dynslam/concepts/camera.hpp"
#include "dynslam/concepts/image.hpp"
#include "dynslam/concepts/robust.hpp"
#include "dynslam/concepts/scalar.hpp"
#include "dynslam/config.hpp"
#include "dynslam/dynamics/free_space.hpp"
#include "dynslam/eval/trajectory.hpp"
#include "dynslam/geometry/brown_conrady.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/geometry/so3.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/image/image_view.hpp"
#include "dynslam/image/sample.hpp"
#include "dynslam/optim/normal_equations.hpp"
#include "dynslam/optim/pose.hpp"
#include "dynslam/robust/kernels.hpp"
#include "dynslam/robust/t_distribution.hpp"
