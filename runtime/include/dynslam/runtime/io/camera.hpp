// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <istream>
#include <string>

#include "dynslam/geometry/brown_conrady.hpp"

namespace dynslam::runtime {

/// A calibrated RGB-D camera whose depth is registered to the colour image.
struct CameraConfig {
  std::string name;
  int width = 640, height = 480;  ///< pixels
  PinholeBrownConrady<double> model;
  double depth_units_per_metre = 5000;  ///< of the 16-bit depth images
  int invalid_depth = 0;                ///< value of the depth images that means "none", as 0 does always
  /// Stamp of a depth image less the time at which it was taken [s]: how late the driver stamps it, beyond
  /// what it does with colour.
  double depth_time_offset = 0;
};

/// A camera by name (fr1, fr2, fr3: TUM RGB-D; bonn: Bonn RGB-D Dynamic) or from a file of `key = value`
/// lines with the keys name, width, height, fx, fy, cx, cy, k1, k2, p1, p2, k3, depth_units_per_metre,
/// invalid_depth, depth_time_offset (distortion 0, 5000 units, no invalid value but 0, no offset where
/// absent).
/// @throws UsageError for a name that is neither, InputError (file, line) for a bad file
[[nodiscard]] CameraConfig load_camera(const std::string& name_or_file);
[[nodiscard]] CameraConfig parse_camera(std::istream& in, const std::string& file);

}  // namespace dynslam::runtime
