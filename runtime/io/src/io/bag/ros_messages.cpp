// SPDX-License-Identifier: BSD-3-Clause
#include "io/bag/ros_messages.hpp"

#include <fmt/format.h>

namespace dynslam::runtime::bag {
namespace {

constexpr const char* kPoseStamped = "geometry_msgs/PoseStamped";
constexpr const char* kTransformStamped = "geometry_msgs/TransformStamped";
constexpr const char* kOdometry = "nav_msgs/Odometry";

void take_head(MessageReader& in, bool compressed, ImageMessage& image) {
  image.header = in.header();
  if (!compressed) {
    image.height = in.u32("the height");
    image.width = in.u32("the width");
  }
  image.encoding = in.text(compressed ? "the format" : "the encoding");
}

PoseMessage take_transform(MessageReader& in) {
  PoseMessage message;
  message.header = in.header();
  message.child = in.frame("the child's frame");
  message.T_parent_child = in.pose();
  return message;
}

PoseMessage take_odometry(MessageReader& in) {
  PoseMessage message;
  message.header = in.header();
  message.child = in.frame("the child's frame");
  message.T_parent_child = in.pose();
  constexpr int kCovariance = 36, kTwist = 6;  // numbers
  for (int k = 0; k < kCovariance + kTwist + kCovariance; ++k) (void)in.f64("covariances and twist");
  return message;
}

}  // namespace

ImageMessage parse_image_head(Bytes bytes, bool compressed, const std::string& name, Serialisation how) {
  MessageReader in(bytes, name, how);
  ImageMessage image;
  take_head(in, compressed, image);
  return image;
}

ImageMessage parse_image(Bytes bytes, const std::string& name, Serialisation how) {
  MessageReader in(bytes, name, how);
  ImageMessage image;
  take_head(in, false, image);
  image.big_endian = in.u8("is_bigendian") != 0;
  image.step = in.u32("the step");
  image.data = in.array("the image");
  in.end();
  return image;
}

ImageMessage parse_compressed_image(Bytes bytes, const std::string& name, Serialisation how) {
  MessageReader in(bytes, name, how);
  ImageMessage image;
  take_head(in, true, image);
  image.data = in.array("the image");
  in.end();
  return image;
}

CameraInfoMessage parse_camera_info(Bytes bytes, const std::string& name, Serialisation how) {
  MessageReader in(bytes, name, how);
  CameraInfoMessage info;
  info.header = in.header();
  info.height = in.u32("the height");
  info.width = in.u32("the width");
  info.distortion_model = in.text("distortion_model");
  const std::uint32_t coefficients = in.u32("D");
  constexpr std::uint32_t kMost = 64;
  if (coefficients > kMost) in.fail(fmt::format("D has {} numbers", coefficients));
  for (std::uint32_t k = 0; k < coefficients; ++k) info.d.push_back(in.f64("D"));
  for (double& x : info.k) x = in.f64("K");
  for (int k = 0; k < 9; ++k) (void)in.f64("R");
  for (double& x : info.p) x = in.f64("P");
  info.binning_x = in.u32("binning_x");
  info.binning_y = in.u32("binning_y");
  info.roi_x = in.u32("roi");
  info.roi_y = in.u32("roi");
  (void)in.bytes(4 + 4 + 1, "roi");  // height, width, whether it is to be rectified
  in.end();
  return info;
}

bool is_read(const Connection& connection) {
  const std::string& type = connection.type;
  return serialisation_of(connection.encoding) &&
         (type == kImage || type == kCompressedImage || type == kCameraInfo || holds_poses(type));
}

bool holds_transforms(const std::string& type) {
  return type == "tf/tfMessage" || type == "tf2_msgs/TFMessage";
}

bool holds_poses(const std::string& type) {
  return holds_transforms(type) || type == kPoseStamped || type == kTransformStamped || type == kOdometry;
}

std::vector<PoseMessage> parse_poses(Bytes bytes, const std::string& type, const std::string& name,
                                     Serialisation how) {
  MessageReader in(bytes, name, how);
  std::vector<PoseMessage> poses;
  if (holds_transforms(type)) {
    const std::uint32_t count = in.u32("the transforms");
    for (std::uint32_t k = 0; k < count; ++k) poses.push_back(take_transform(in));
  } else if (type == kTransformStamped) {
    poses.push_back(take_transform(in));
  } else if (type == kOdometry) {
    poses.push_back(take_odometry(in));
  } else if (type == kPoseStamped) {
    PoseMessage message;
    message.header = in.header();
    message.T_parent_child = in.pose();
    poses.push_back(std::move(message));
  } else {
    in.fail("holds no poses");
  }
  in.end();
  return poses;
}

}  // namespace dynslam::runtime::bag
