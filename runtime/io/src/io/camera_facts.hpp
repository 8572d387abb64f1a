// SPDX-License-Identifier: BSD-3-Clause
// What the formats of camera files have in common. Internal to the runtime.
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "dynslam/runtime/io/camera.hpp"

namespace dynslam::runtime {

/// What a file says of a camera under the names of dynslam's own format (docs/cameras.md), not yet checked:
/// whatever a file is written in becomes this first.
struct CameraFacts {
  std::map<std::string, double, std::less<>> numbers;     ///< width, fx, k1, depth_units_per_metre, ...
  std::map<std::string, std::string, std::less<>> words;  ///< name, model, depth_noise
};

/// Whether the name is one of a number, or of a word.
[[nodiscard]] bool is_camera_number(std::string_view key);
[[nodiscard]] bool is_camera_word(std::string_view key);

/// `key = value` lines. @throws InputError (line)
[[nodiscard]] CameraFacts parse_own_camera(const std::string& text, const std::string& file);
/// ROS' camera_info and OpenCV's FileStorage, YAML or XML. @throws InputError (line)
[[nodiscard]] CameraFacts parse_calibration(const std::string& text, const std::string& file);

/// Open3D's {"width", "height", "intrinsic_matrix"} and NICE-SLAM's {"camera": {"w", "h", "fx", ...}}, with
/// numbers under dynslam's names beside them. @throws InputError
[[nodiscard]] CameraFacts parse_json_camera(const std::string& text, const std::string& file);

/// @throws InputError naming the file: a missing number, one out of its range, one that the model lacks
[[nodiscard]] CameraConfig camera_of_facts(const CameraFacts& facts, const std::string& file);

struct NamedWords;  // of calibration_text.hpp
/// The same of what such a file holds. @throws InputError (line)
[[nodiscard]] CameraFacts facts_of_calibration(const std::vector<NamedWords>& nodes, const std::string& file);

/// As the other load_camera(), for sequences whose depth has so many units per metre unless the file says
/// otherwise; the units of named cameras are those of the data sets that they are published with.
[[nodiscard]] CameraConfig load_camera(const std::string& name_or_file, double usual_units);

}  // namespace dynslam::runtime
