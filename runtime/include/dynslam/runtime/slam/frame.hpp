// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/features/descriptor.hpp"
#include "dynslam/features/feature.hpp"
#include "dynslam/features/feature_grid.hpp"
#include "dynslam/features/guided_match.hpp"
#include "dynslam/map/frame.hpp"

namespace dynslam::runtime {

using dynslam::Descriptor;
using dynslam::Feature;
using dynslam::FeatureGrid;
using dynslam::hamming_distance;
using dynslam::observe;
using Frame = dynslam::Frame<double>;

}  // namespace dynslam::runtime
