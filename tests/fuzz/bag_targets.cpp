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
}

}  // namespace dynslam::fuzz
