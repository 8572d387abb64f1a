// SPDX-License-Identifier: BSD-3-Clause
#include <array>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "bag_writer.hpp"
#include "dynslam/runtime/error.hpp"
#include "io/bag/bag_file.hpp"
#include "io/bag/bag_survey.hpp"
#include "io/bag/bag_topics.hpp"
#include "io/bag/bag_truth.hpp"
#include "io/bag/ros_images.hpp"
#include "io/bag/ros_messages.hpp"
#include "io/literal_inflate.hpp"
#include "targets.hpp"

namespace dynslam::fuzz {
namespace {

namespace bag = runtime::bag;
using runtime::InputError;

/// All that is read of a bag, its images decoded.
void bag_file(Bytes bytes) {
  try {
    const auto file = bag::BagFile(
        std::make_unique<bag::MemoryBytes>("bag", std::vector<std::uint8_t>(bytes.begin(), bytes.end())));
    const bag::BagSurvey found = bag::survey(file);
    (void)bag::truth_of(found, "f");
    for (const bag::ImageTopic& topic : found.images) {
      try {
        (void)bag::camera_beside(found, topic);
      } catch (const InputError&) {
      }
      for (const bag::Shot& shot : topic.shots) (void)file.read(shot.place);
    }
    (void)bag::choose_topics(found, "");
  } catch (const InputError&) {
  }
}

/// The first byte says what the message is.
void ros_message(Bytes bytes) {
  if (bytes.empty()) return;
  const Bytes message = bytes.subspan(1);
  constexpr std::array<const char*, 5> kPoses{"tf/tfMessage", "geometry_msgs/PoseStamped",
                                              "geometry_msgs/TransformStamped", "nav_msgs/Odometry", "none"};
  try {
    const int kind = bytes[0] % 10;
    const bool compressed = kind % 2 != 0;
    if (kind < 4) {
      const bag::ImageMessage image =
          compressed ? bag::parse_compressed_image(message, "m") : bag::parse_image(message, "m");
      (void)bag::size_of(image, compressed, "m");
      (void)(kind < 2 ? bag::decode_colour(image, compressed, "m")
                      : bag::decode_depth(image, compressed, "m"));
    } else if (kind == 4) {
      (void)bag::parse_camera_info(message, "m");
    } else {
      (void)bag::parse_poses(message, kPoses[static_cast<std::size_t>(kind - 5)], "m");
    }
  } catch (const InputError&) {
  }
}

/// The size of what comes out, then the stream.
void literal_stream(Bytes bytes) {
  if (bytes.size() < 2) return;
  std::vector<std::uint8_t> out(std::size_t{bytes[0]} << 4 | bytes[1] % 16U);
  static runtime::LiteralInflater inflater;
  (void)inflater.decompress(bytes.subspan(2), out);
}

std::string of_kind(int kind, const std::string& message) {
  std::string seed(1, static_cast<char>(kind));
  seed += message;
  return seed;
}

std::vector<std::string> message_seeds() {
  using namespace test;
  const cv::Mat colour(2, 3, CV_8UC3, cv::Scalar(1, 2, 3)), depth(2, 2, CV_16UC1, cv::Scalar(900));
  std::string png("\x89PNG\r\n\x1A\n\0\0\0\x0DIHDR\0\0\0\x02\0\0\0\x02\x10\0\0\0\0", 29), coded(12, '\x01');
  coded += png;
  const SE3<double> pose;
  return {of_kind(0, image_message(5, "f", "rgb8", colour)),
          of_kind(1, compressed_message(5, "f", "rgb8; png compressed bgr8", png)),
          of_kind(2, image_message(5, "f", "16UC1", depth)),
          of_kind(3, compressed_message(5, "f", "32FC1; compressedDepth png", coded)),
          of_kind(4, info_message(5, "f", {})),
          of_kind(5, tf_message(5, {{"w", "f", pose}, {"f", "g", pose}})),
          of_kind(6, pose_message(5, "w", pose)),
          of_kind(8, odometry_message(5, "f", pose))};
}

std::vector<std::string> literal_seeds() {
  // Of 300 bytes, i i / 7 % 11 each.
  constexpr std::array<std::uint8_t, 150> kStream{
      0x12, 0x0c, 0x78, 0x01, 0x05, 0xc1, 0x81, 0x0d, 0x00, 0x30, 0x08, 0x02, 0x30, 0x84, 0x30, 0xc1, 0xff,
      0x0f, 0x5e, 0x0b, 0x60, 0x28, 0x6f, 0xa1, 0x57, 0xbe, 0x53, 0xb8, 0x8c, 0xea, 0x89, 0x79, 0x6b, 0x0d,
      0xae, 0x49, 0xd2, 0xc3, 0xc8, 0x7b, 0x74, 0xc6, 0x55, 0xb8, 0x8c, 0xee, 0xb1, 0x4f, 0xe8, 0x5a, 0x1c,
      0x00, 0xc0, 0x50, 0xde, 0x42, 0xaf, 0x7c, 0xa7, 0x70, 0x19, 0xd5, 0x13, 0xf3, 0xd6, 0x1a, 0x5c, 0x93,
      0xa4, 0x87, 0x91, 0xf7, 0xe8, 0x8c, 0xab, 0x70, 0x19, 0xdd, 0x63, 0x9f, 0xd0, 0xb5, 0x38, 0x00, 0x80,
      0xa1, 0xbc, 0x85, 0x5e, 0xf9, 0x4e, 0xe1, 0x32, 0xaa, 0x27, 0xe6, 0xad, 0x35, 0xb8, 0x26, 0x49, 0x0f,
      0x23, 0xef, 0xd1, 0x19, 0x57, 0xe1, 0x32, 0xba, 0xc7, 0x3e, 0xa1, 0x6b, 0x71, 0x00, 0x00, 0x43, 0x79,
      0x0b, 0xbd, 0xf2, 0x9d, 0xc2, 0x65, 0x54, 0x4f, 0xcc, 0x5b, 0x6b, 0x70, 0x4d, 0x92, 0x1e, 0x46, 0xde,
      0xa3, 0x33, 0xae, 0xc2, 0x65, 0x74, 0x8f, 0x7d, 0xc2, 0x07, 0x56, 0xb0, 0x05, 0xbe};
  return {std::string(kStream.begin(), kStream.end())};
}

std::vector<std::string> bag_seeds() {
  using namespace test;
  BagWriter writer;
  const cv::Mat colour(2, 2, CV_8UC3, cv::Scalar(1, 2, 3)), depth(2, 2, CV_16UC1, cv::Scalar(900));
  for (std::uint64_t t = 1; t < 3; ++t) {
    writer.add("/c/image", "sensor_msgs/Image", t, image_message(t, "f", "rgb8", colour));
    writer.add("/d/image", "sensor_msgs/Image", t, image_message(t, "f", "16UC1", depth));
    writer.add("/c/camera_info", "sensor_msgs/CameraInfo", t, info_message(t, "f", {}));
    writer.add("/tf", "tf/tfMessage", t, tf_message(t, {{"w", "f", {}}}));
  }
  return {writer.bytes(3)};
}

}  // namespace

void add_bag_targets(std::vector<Target>& targets) {
  targets.push_back({"bag", bag_file, bag_seeds});
  targets.push_back({"ros_message", ros_message, message_seeds});
  targets.push_back({"literal_stream", literal_stream, literal_seeds});
}

}  // namespace dynslam::fuzz
