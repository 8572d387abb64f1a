// SPDX-License-Identifier: BSD-3-Clause
#include <unistd.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "bag_writer.hpp"
#include "dynslam/runtime/error.hpp"
#ifdef DYNSLAM_TEST_SQLITE3
#include "db3_writer.hpp"
#endif
#include "io/bag/bag_file.hpp"
#include "io/bag/bag_survey.hpp"
#include "io/bag/bag_topics.hpp"
#include "io/bag/bag_truth.hpp"
#include "io/bag/db3_file.hpp"
#include "io/bag/mcap_file.hpp"
#include "io/bag/ros2_recording.hpp"
#include "io/bag/ros_images.hpp"
#include "io/bag/ros_messages.hpp"
#include "mcap_writer.hpp"
#include "targets.hpp"

namespace dynslam::fuzz {
namespace {

namespace bag = runtime::bag;
using runtime::InputError;

/// All that is read of a recording, its images decoded.
void read_all(const bag::Recording& file) {
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
}

std::vector<std::uint8_t> copy_of(Bytes bytes) {
  return {bytes.begin(), bytes.end()};
}

void bag_file(Bytes bytes) try {
  read_all(bag::BagFile(std::make_unique<bag::MemoryBytes>("bag", copy_of(bytes))));
} catch (const InputError&) {
}

void mcap_file(Bytes bytes) try {
  read_all(*bag::open_ros2(
      std::make_unique<bag::McapFile>(std::make_unique<bag::MemoryBytes>("mcap", copy_of(bytes)))));
} catch (const InputError&) {
}

void db3_file(Bytes bytes) try {
  read_all(*bag::open_ros2(std::make_unique<bag::Db3File>(copy_of(bytes), "db3")));
} catch (const InputError&) {
}

/// The first byte says what the message is.
void message_of(Bytes bytes, bag::Serialisation how) {
  if (bytes.empty()) return;
  const Bytes message = bytes.subspan(1);
  constexpr std::array<const char*, 5> kPoses{"tf/tfMessage", "geometry_msgs/PoseStamped",
                                              "geometry_msgs/TransformStamped", "nav_msgs/Odometry", "none"};
  try {
    const int kind = bytes[0] % 10;
    const bool compressed = kind % 2 != 0;
    if (kind < 4) {
      const bag::ImageMessage image =
          compressed ? bag::parse_compressed_image(message, "m", how) : bag::parse_image(message, "m", how);
      (void)bag::size_of(image, compressed, "m");
      (void)(kind < 2 ? bag::decode_colour(image, compressed, "m")
                      : bag::decode_depth(image, compressed, "m"));
    } else if (kind == 4) {
      (void)bag::parse_camera_info(message, "m", how);
    } else {
      (void)bag::parse_poses(message, kPoses[static_cast<std::size_t>(kind - 5)], "m", how);
    }
  } catch (const InputError&) {
  }
}

void ros_message(Bytes bytes) {
  message_of(bytes, bag::Serialisation::ros1);
}
void cdr_message(Bytes bytes) {
  message_of(bytes, bag::Serialisation::cdr);
}

std::string of_kind(int kind, const std::string& message) {
  std::string seed(1, static_cast<char>(kind));
  seed += message;
  return seed;
}

std::vector<std::string> seeds_by(test::Wire wire) {
  using namespace test;
  const cv::Mat colour(2, 3, CV_8UC3, cv::Scalar(1, 2, 3)), depth(2, 2, CV_16UC1, cv::Scalar(900));
  std::string png("\x89PNG\r\n\x1A\n\0\0\0\x0DIHDR\0\0\0\x02\0\0\0\x02\x10\0\0\0\0", 29), coded(12, '\x01');
  coded += png;
  const SE3<double> pose;
  return {of_kind(0, image_message(5, "f", "rgb8", colour, wire)),
          of_kind(1, compressed_message(5, "f", "rgb8; png compressed bgr8", png, wire)),
          of_kind(2, image_message(5, "f", "16UC1", depth, wire)),
          of_kind(3, compressed_message(5, "f", "32FC1; compressedDepth png", coded, wire)),
          of_kind(4, info_message(5, "f", {}, wire)),
          of_kind(5, tf_message(5, {{"w", "f", pose}, {"f", "g", pose}}, wire)),
          of_kind(6, pose_message(5, "w", pose, wire)),
          of_kind(8, odometry_message(5, "f", pose, wire))};
}

std::vector<std::string> message_seeds() {
  return seeds_by(test::Wire::ros1);
}

std::vector<std::string> cdr_seeds() {
  std::vector<std::string> seeds = seeds_by(test::Wire::cdr_little);
  for (std::string& seed : seeds_by(test::Wire::cdr_big)) seeds.push_back(std::move(seed));
  return seeds;
}

template <class Writer>
Writer few_messages(test::Wire wire) {
  using namespace test;
  Writer writer;
  const cv::Mat colour(2, 2, CV_8UC3, cv::Scalar(1, 2, 3)), depth(2, 2, CV_16UC1, cv::Scalar(900));
  for (std::uint64_t t = 1; t < 3; ++t) {
    writer.add("/c/image", "sensor_msgs/Image", t, image_message(t, "f", "rgb8", colour, wire));
    writer.add("/d/image", "sensor_msgs/Image", t, image_message(t, "f", "16UC1", depth, wire));
    writer.add("/c/camera_info", "sensor_msgs/CameraInfo", t, info_message(t, "f", {}, wire));
    writer.add("/tf", "tf/tfMessage", t, tf_message(t, {{"w", "f", {}}}, wire));
  }
  return writer;
}

std::vector<std::string> bag_seeds() {
  return {few_messages<test::BagWriter>(test::Wire::ros1).bytes(3)};
}

/// Check sums would hide from the search what stands behind them.
std::vector<std::string> mcap_seeds() {
  const auto writer = few_messages<test::McapWriter>(test::Wire::cdr_little);
  std::vector<std::string> seeds{writer.bytes({0, "", false, false, "cdr"})};
  for (const std::string& compression : test::mcap_compressions())
    seeds.push_back(writer.bytes({3, compression, true, false, "cdr"}));
  return seeds;
}

std::vector<std::string> db3_seeds() {
#ifdef DYNSLAM_TEST_SQLITE3
  const std::filesystem::path file =
      std::filesystem::temp_directory_path() / ("dynslam_seed_" + std::to_string(::getpid()) + ".db3");
  std::vector<std::string> seeds;
  for (const char* compression : {"", "zstd"}) {
    few_messages<test::Db3Writer>(test::Wire::cdr_little).write(file, "PRAGMA page_size = 512", compression);
    std::ifstream in(file, std::ios::binary);
    seeds.emplace_back(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
    std::filesystem::remove(file);
  }
  return seeds;
#else
  return {"SQLite format 3"};
#endif
}

}  // namespace

void add_bag_targets(std::vector<Target>& targets) {
  targets.push_back({"bag", bag_file, bag_seeds});
  targets.push_back({"ros_message", ros_message, message_seeds});
  targets.push_back({"mcap", mcap_file, mcap_seeds});
  targets.push_back({"db3", db3_file, db3_seeds});
  targets.push_back({"cdr_message", cdr_message, cdr_seeds});
}

}  // namespace dynslam::fuzz
