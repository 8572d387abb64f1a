// SPDX-License-Identifier: BSD-3-Clause
// Messages as ROS 2 serialises them.
#include <doctest/doctest.h>

#include <string>
#include <vector>

#include "error_text.hpp"
#include "io/bag/ros_images.hpp"
#include "io/bag/ros_messages.hpp"
#include "ros_message_writer.hpp"

namespace {

using namespace dynslam;
using test::error_of, test::mentions, test::Serialised, test::Wire;
namespace bag = runtime::bag;

constexpr auto kCdr = bag::Serialisation::cdr;

std::vector<std::uint8_t> cdr_bytes(const std::string& message) {
  return {message.begin(), message.end()};
}

const SE3<double> kSomePose(Eigen::Quaterniond(0.8, 0.1, -0.5, 0.3).normalized(),
                            Eigen::Vector3d(1.25, -2, 3));

/// Whether messages of poses hold this one, of `child` in `parent`.
void check_pose(const std::string& message, const char* type, const char* parent, const char* child) {
  const auto poses = bag::parse_poses(cdr_bytes(message), type, "m", kCdr);
  REQUIRE(poses.size() == 1);
  CHECK(poses[0].header.seconds == 12);
  CHECK(poses[0].header.nanoseconds == 345);
  CHECK(poses[0].header.frame == parent);
  CHECK(poses[0].child == child);
  CHECK((poses[0].T_parent_child.inverse() * kSomePose).log().norm() < 1e-12);
}

}  // namespace

TEST_CASE("messages of ROS 2 are decoded in both byte orders, whatever the lengths of their texts") {
  constexpr std::uint64_t t = 12000000345U;
  for (const Wire wire : {Wire::cdr_little, Wire::cdr_big}) {
    for (const char* frame : {"", "f", "fr", "fra", "fram", "frame", "frame_", "frame_i", "frame_id"}) {
      CAPTURE(frame);
      const cv::Mat colour(2, 3, CV_8UC3, cv::Scalar(1, 2, 3));
      const auto raw = cdr_bytes(test::image_message(t, frame, "bgr8", colour, wire));
      const bag::ImageMessage image = bag::parse_image(raw, "m", kCdr);
      CHECK(image.header.seconds == 12);
      CHECK(image.header.nanoseconds == 345);
      CHECK(image.header.frame == frame);
      CHECK(image.encoding == "bgr8");
      CHECK(bag::decode_colour(image, false, "m").at<cv::Vec3b>(1, 2) == cv::Vec3b(1, 2, 3));
      CHECK(bag::parse_image_head(raw, false, "m", kCdr).encoding == "bgr8");

      const auto packed = cdr_bytes(test::compressed_message(t, frame, "jpeg", "12345", wire));
      const bag::ImageMessage compressed = bag::parse_compressed_image(packed, "m", kCdr);
      CHECK(compressed.encoding == "jpeg");
      CHECK(std::string(compressed.data.begin(), compressed.data.end()) == "12345");

      test::InfoOfCamera camera;
      camera.d = {0.1, -0.2, 0.3, 0.4, 0.5};
      camera.binning = 2;
      const auto info =
          bag::parse_camera_info(cdr_bytes(test::info_message(t, frame, camera, wire)), "m", kCdr);
      CHECK(info.width == 640);
      CHECK(info.height == 480);
      CHECK(info.distortion_model == "plumb_bob");
      CHECK(info.d == camera.d);
      CHECK(info.k[4] == 539.2);
      CHECK(info.p[6] == 247.6);
      CHECK(info.binning_y == 2);

      check_pose(test::tf_message(t, {{"world", frame, kSomePose}}, wire), "tf2_msgs/TFMessage", "world",
                 frame);
      check_pose(test::pose_message(t, frame, kSomePose, wire), "geometry_msgs/PoseStamped", frame, "");
      check_pose(test::odometry_message(t, frame, kSomePose, wire), "nav_msgs/Odometry", "odom", frame);
    }
  }
}

TEST_CASE("several transforms in one message of ROS 2 are all found") {
  const auto poses =
      bag::parse_poses(cdr_bytes(test::tf_message(
                           5, {{"a", "bc", {}}, {"abc", "d", kSomePose}, {"e", "", {}}}, Wire::cdr_little)),
                       "tf2_msgs/TFMessage", "m", kCdr);
  REQUIRE(poses.size() == 3);
  CHECK(poses[1].child == "d");
  CHECK((poses[1].T_parent_child.inverse() * kSomePose).log().norm() < 1e-12);
}

TEST_CASE("CDR that ends too early, of another kind, or with wrong stamps is refused by name") {
  const std::string whole =
      test::image_message(5, "f", "rgb8", cv::Mat(4, 4, CV_8UC3, cv::Scalar::all(0)), Wire::cdr_little);
  for (std::size_t size = 0; size < whole.size(); ++size)
    CHECK(mentions(error_of([&] { (void)bag::parse_image(cdr_bytes(whole.substr(0, size)), "m", kCdr); }),
                   "m: the message ends at byte"));
  // Middleware fills up to a multiple of eight.
  CHECK(error_of([&] { (void)bag::parse_image(cdr_bytes(whole + "1234567"), "m", kCdr); }).empty());
  CHECK(mentions(error_of([&] { (void)bag::parse_image(cdr_bytes(whole + "12345678"), "m", kCdr); }),
                 "8 bytes are left"));
  std::string other = whole;
  other[1] = '\3';  // a list of parameters
  CHECK(mentions(error_of([&] { (void)bag::parse_image(cdr_bytes(other), "m", kCdr); }), "CDR of kind 3"));
  const auto stamped = [](std::uint32_t seconds, std::uint32_t nanoseconds) {
    const auto bytes =
        cdr_bytes(Serialised(Wire::cdr_little).u32(seconds).u32(nanoseconds).text("f").bytes());
    return error_of([&] { (void)bag::parse_image_head(bytes, false, "m", kCdr); });
  };
  CHECK(mentions(stamped(~0U, 0), "before 1970"));
  CHECK(mentions(stamped(1, 1000000000U), "1000000000 nanoseconds"));
  // As many transforms as there are numbers.
  const auto many = cdr_bytes(Serialised(Wire::cdr_little).u32(~0U).bytes());
  CHECK(mentions(error_of([&] { (void)bag::parse_poses(many, "tf2_msgs/TFMessage", "m", kCdr); }),
                 "ends at byte"));
}
