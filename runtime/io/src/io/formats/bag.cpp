// SPDX-License-Identifier: BSD-3-Clause
// Recordings of ROS 1 and of ROS 2.
#include <memory>

#include "dynslam/runtime/error.hpp"
#include "io/bag/bag_file.hpp"
#include "io/bag/ros2_recording.hpp"
#include "io/formats/format.hpp"
#include "io/formats/recording.hpp"

namespace dynslam::runtime::formats {
namespace {

namespace fs = std::filesystem;

Sequence load_bag(const fs::path& root, const SequenceOptions& options) {
  if (fs::is_directory(root)) throw InputError(root.string(), 0, "is a folder, not a bag");
  return load_recording(std::make_shared<const bag::BagFile>(std::make_unique<bag::FileBytes>(root)), root,
                        options);
}

Sequence load_ros2(const fs::path& root, const SequenceOptions& options) {
  return load_recording(bag::open_ros2(root), root, options);
}

}  // namespace

const Format kBag{"bag", "a ROS 1 bag, FILE.bag", bag::is_bag, load_bag};
const Format kRos2{"ros2", "a recording of ROS 2: FILE.mcap, FILE.db3, or a folder with metadata.yaml",
                   bag::is_ros2, load_ros2};

}  // namespace dynslam::runtime::formats
