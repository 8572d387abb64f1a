// SPDX-License-Identifier: BSD-3-Clause
// The messages that a sequence is made of, decoded from what ROS 1 or ROS 2 serialises. Whatever the bytes
// are, the result is a message or an InputError.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "dynslam/geometry/se3.hpp"
#include "io/bag/message_reader.hpp"
#include "io/bag/recording.hpp"

namespace dynslam::runtime::bag {

/// sensor_msgs/Image, and sensor_msgs/CompressedImage with its `format` as the encoding.
struct ImageMessage {
  Header header;
  std::string encoding;
  std::uint32_t height = 0, width = 0, step = 0;  ///< of raw ones
  bool big_endian = false;
  Bytes data;  ///< of the buffer that was parsed
};

/// sensor_msgs/CameraInfo.
struct CameraInfoMessage {
  Header header;
  std::uint32_t height = 0, width = 0;
  std::string distortion_model;
  std::vector<double> d;
  std::array<double, 9> k{};
  std::array<double, 12> p{};
  std::uint32_t binning_x = 0, binning_y = 0, roi_x = 0, roi_y = 0;
};

/// A pose of `child` in `header.frame`.
struct PoseMessage {
  Header header;
  std::string child;  ///< empty: the message does not say
  SE3<double> T_parent_child;
};

inline constexpr const char* kImage = "sensor_msgs/Image";
inline constexpr const char* kCompressedImage = "sensor_msgs/CompressedImage";
inline constexpr const char* kCameraInfo = "sensor_msgs/CameraInfo";

/// What they throw names `name`. @throws InputError
[[nodiscard]] ImageMessage parse_image(Bytes bytes, const std::string& name,
                                       Serialisation how = Serialisation::ros1);
[[nodiscard]] ImageMessage parse_compressed_image(Bytes bytes, const std::string& name,
                                                  Serialisation how = Serialisation::ros1);
/// Header and encoding alone, of the first bytes of a message (kHead are enough) of either type.
inline constexpr std::uint32_t kHead = 2048;
[[nodiscard]] ImageMessage parse_image_head(Bytes bytes, bool compressed, const std::string& name,
                                            Serialisation how = Serialisation::ros1);
[[nodiscard]] CameraInfoMessage parse_camera_info(Bytes bytes, const std::string& name,
                                                  Serialisation how = Serialisation::ros1);

/// Whether a sequence is made of messages like these: of a type and an encoding that are read.
[[nodiscard]] bool is_read(const Connection& connection);
/// Whether messages of this type hold poses: tf/tfMessage, tf2_msgs/TFMessage, geometry_msgs/PoseStamped,
/// geometry_msgs/TransformStamped, nav_msgs/Odometry.
[[nodiscard]] bool holds_poses(const std::string& type);
/// tf/tfMessage or tf2_msgs/TFMessage.
[[nodiscard]] bool holds_transforms(const std::string& type);
[[nodiscard]] std::vector<PoseMessage> parse_poses(Bytes bytes, const std::string& type,
                                                   const std::string& name,
                                                   Serialisation how = Serialisation::ros1);

}  // namespace dynslam::runtime::bag
