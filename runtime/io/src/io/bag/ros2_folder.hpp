// SPDX-License-Identifier: BSD-3-Clause
// The folder that rosbag2 makes of a recording: files NAME_0.mcap, NAME_1.mcap, ... and, once the recorder is
// closed, metadata.yaml.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace dynslam::runtime::bag {

/// Whether a folder holds a metadata.yaml of rosbag2, or files named as above.
[[nodiscard]] bool is_ros2_folder(const std::filesystem::path& folder);

/// Its files in their order. @param missing  gets a line for what is not there @throws InputError
[[nodiscard]] std::vector<std::filesystem::path> files_of_ros2(const std::filesystem::path& folder,
                                                               std::vector<std::string>& missing);

}  // namespace dynslam::runtime::bag
