// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/geometry/brown_conrady.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/map/place_verifier.hpp"
#include "dynslam/runtime/slam/local_map.hpp"

namespace dynslam::runtime {

using PlaceOptions = dynslam::PlaceOptions<double>;
using PlaceVerifier = dynslam::PlaceVerifier<Pinhole<double>, PinholeBrownConrady<double>>;

}  // namespace dynslam::runtime
