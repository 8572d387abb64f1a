// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <filesystem>
#include <istream>
#include <optional>
#include <string>

#include "dynslam/geometry/any_camera.hpp"
#include "dynslam/image/depth.hpp"

namespace dynslam::runtime {

/// A calibrated RGB-D camera whose depth is registered to the colour image.
struct CameraConfig {
  std::string name;
  int width = 640, height = 480;  ///< pixels
  AnyCamera<double> model;
  double depth_units_per_metre = 5000;  ///< of the 16-bit depth images
  int invalid_depth = 0;                ///< value of the depth images that means "none", as 0 does always
  /// Stamp of a depth image less the time at which it was taken [s]: how late the driver stamps it, beyond
  /// what it does with colour.
  double depth_time_offset = 0;
  /// From the first row of the colour image to the last [s], 0: all rows at once (a global shutter),
  /// negative: from the last to the first. A frame's stamp and pose are those of its middle row.
  double readout_time = 0;
  /// Of its depth; empty: it is unknown, and the options' are used as they are. See docs/cameras.md.
  std::optional<DepthNoise<double>> depth_noise{};
};

/// A camera by name (fr1, fr2, fr3: TUM RGB-D; bonn: Bonn RGB-D Dynamic; a preset's in
/// ../share/dynslam/cameras beside the program, as realsense_d435) or from a file, which goes before a
/// preset: `key = value` lines, ROS' camera_info in YAML, or OpenCV's FileStorage in YAML or XML, told apart
/// by what they hold. The keys are those of docs/cameras.md; a file that does not say how many units a metre
/// of depth has gets 5000 where it has `key = value` lines and 1000 otherwise.
/// @throws UsageError for a name that is neither, InputError (file, line) for a bad file
[[nodiscard]] CameraConfig load_camera(const std::string& name_or_file);
/// The same of a file's text; `file` is its name for error messages.
[[nodiscard]] CameraConfig parse_camera(std::istream& in, const std::string& file);

/// The camera file of a sequence's folder: camera.txt, camera.yaml, camera.yml or camera.xml; empty: none.
/// @throws InputError where there are several
[[nodiscard]] std::filesystem::path camera_file_in(const std::filesystem::path& folder);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
