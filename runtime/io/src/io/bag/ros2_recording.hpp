// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <memory>

#include "io/bag/recording.hpp"

namespace dynslam::runtime::bag {

/// Whether this is a recording of ROS 2: an MCAP file, a database of SQLite, one of these compressed by zstd,
/// or a folder of such files with rosbag2's metadata.yaml or, where the recorder was not closed, NAME_0.mcap.
[[nodiscard]] bool is_ros2(const std::filesystem::path& path);

/// All files of a recording as one; messages that are compressed one by one are decompressed when they are
/// read. @throws InputError
[[nodiscard]] std::shared_ptr<const Recording> open_ros2(const std::filesystem::path& path);

/// The same of one file in memory. @throws InputError
[[nodiscard]] std::shared_ptr<const Recording> open_ros2(std::unique_ptr<Recording> file);

}  // namespace dynslam::runtime::bag
