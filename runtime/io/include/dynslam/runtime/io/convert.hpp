// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <filesystem>
#include <functional>
#include <opencv2/core/types.hpp>
#include <string>
#include <vector>

#include "dynslam/runtime/io/sequence.hpp"

namespace dynslam::runtime {

/// What convert_sequence() changes on the way.
struct ConvertOptions {
  cv::Size size{};        ///< of the new images [px]; empty: as they are
  std::size_t every = 1;  ///< one of so many frames is taken, the first one first
};

/// What convert_sequence() did.
struct ConvertReport {
  std::size_t written = 0;
  std::size_t without_depth = 0;  ///< of them, frames whose new depth image has none at all
  std::size_t depth_pixels = 0;   ///< with depth, over all frames
  std::size_t too_far =
      0;  ///< of them, those that 16 bits of the camera's units cannot hold: 0 in the new one
  std::vector<std::string> broken;  ///< frames that could not be read and were left out, one line each
};

/// Writes a sequence of any format as a folder of TUM's layout: PNG images, associations.txt, rgb.txt,
/// depth.txt, camera.txt and, where there is one, groundtruth.txt. Times are kept, and name the files (depth
/// of a time that another image has: both times); depth in the camera's units, what it says to be none as 0.
/// Colour is scaled by averaging or bicubic, depth by the nearest pixel, the camera with them.
/// @param out  a new or empty folder, or one that an interrupted conversion left (it holds unfinished.txt)
/// @throws UsageError  an image of less than 64 or more than 8192 pixels a side, `every` of 0
/// @throws InputError  `out` holds something or cannot be written; more than half of the frames are broken
ConvertReport convert_sequence(const Sequence& sequence, const CameraConfig& camera,
                               const std::filesystem::path& out, const ConvertOptions& options = {},
                               const std::function<void(std::size_t done, std::size_t total)>& progress = {});

/// The camera of images that were scaled to another size.
[[nodiscard]] CameraConfig scaled_camera(const CameraConfig& camera, cv::Size size);

/// A camera as lines of `key = value`, which load_camera() reads. @param camera  its noise is that of one of
/// the models of docs/cameras.md
[[nodiscard]] std::string camera_text(const CameraConfig& camera);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
