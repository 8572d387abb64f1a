// SPDX-License-Identifier: BSD-3-Clause
// The reader of bags and of their messages: what stands in a bag, and what damage does to it.
#include <doctest/doctest.h>

#include <cmath>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "bag_fixture.hpp"
#include "error_text.hpp"
#include "io/bag/bag_chunk.hpp"
#include "io/bag/bag_file.hpp"
#include "io/bag/bag_survey.hpp"
#include "io/bag/ros_images.hpp"
#include "io/bag/ros_messages.hpp"
#include "random.hpp"

namespace {

using namespace dynslam;
using test::BagWriter, test::compressed_message, test::depth_header, test::error_of, test::image_message,
    test::info_message, test::InfoOfCamera, test::mentions, test::png, test::Rng, test::Serialised,
    test::tf_message;
namespace bag = runtime::bag;

std::vector<std::uint8_t> vector_of(const std::string& bytes) {
  return {bytes.begin(), bytes.end()};
}

bag::BagFile bag_of(const std::string& content) {
  return bag::BagFile(std::make_unique<bag::MemoryBytes>("x.bag", vector_of(content)));
}

/// Small: 64x64 images, camera and tf.
BagWriter small_bag() {
  BagWriter writer;
  const cv::Mat colour(64, 64, CV_8UC3, cv::Scalar(10, 20, 30)), depth(64, 64, CV_16UC1, cv::Scalar(1500));
  InfoOfCamera camera;
  camera.width = camera.height = 64;
  camera.k = {60, 60, 32, 32};
  for (std::uint64_t k = 1; k <= 5; ++k) {
    const std::uint64_t t = k * 100000000U;
    writer.add("/c", "sensor_msgs/Image", t, image_message(t, "f", "rgb8", colour));
    writer.add("/i/camera_info", "sensor_msgs/CameraInfo", t, info_message(t, "f", camera));
    writer.add("/d/compressed", "sensor_msgs/CompressedImage", t,
               compressed_message(t, "f", "16UC1; png compressed", png(depth)));
    writer.add("/tf", "tf/tfMessage", t, tf_message(t, {{"w", "f", {}}}));
    writer.add("/talk", "std_msgs/String", t, Serialised().text("hello").bytes());
  }
  return writer;
}

std::string bag_error(const std::string& content) {
  return error_of([&] {
    const bag::BagFile file = bag_of(content);
    (void)bag::survey(file);
  });
}

/// Replaces a text that must be there by one of the same length.
std::string with(std::string content, const std::string& old, const std::string& replacement) {
  REQUIRE(old.size() == replacement.size());
  const auto at = content.find(old);
  REQUIRE(at != std::string::npos);
  return content.replace(at, old.size(), replacement);
}

bag::ImageMessage image_of(const std::vector<std::uint8_t>& bytes) {
  return bag::parse_image(bytes, "image");
}

}  // namespace

TEST_CASE("a bag's topics, images, cameras and transforms are found, whatever the chunks") {
  for (const std::size_t per_chunk : {1U, 3U, 100U}) {
    const bag::BagFile file = bag_of(small_bag().bytes(per_chunk));
    CHECK(file.connections().size() == 5);
    const bag::BagSurvey found = bag::survey(file);
    REQUIRE(found.images.size() == 2);
    CHECK(found.images[0].name == "/c");
    CHECK(found.images[0].shots.size() == 5);
    CHECK(found.images[0].shots[4].stamp == 500000000U);
    CHECK(found.images[1].encoding == "16UC1; png compressed");
    CHECK(found.images[1].kind == bag::ImageKind::depth);
    CHECK(found.infos.at("/i/camera_info").info.k[0] == 60);
    CHECK_FALSE(found.infos.at("/i/camera_info").changes);
    REQUIRE(found.tracks.size() == 1);
    CHECK(found.tracks[0].poses.size() == 5);
    const auto bytes = file.read(found.images[0].shots[2].place);
    CHECK(bag::decode_colour(image_of(bytes), false, "c").at<cv::Vec3b>(9, 9) == cv::Vec3b(30, 20, 10));
  }
}

TEST_CASE("a bag that ends too early is refused wherever it ends") {
  const std::string whole = small_bag().bytes();
  CHECK(bag_error(whole).empty());
  const std::size_t index = whole.size() - 3000;
  for (std::size_t size = 0; size<whole.size(); size += size> index ? 7 : 1009) {
    CAPTURE(size);
    const std::string error = bag_error(whole.substr(0, size));
    // Between two records of the index that come after all connections nothing is missing.
    if (size < index) CHECK(mentions(error, "x.bag"));
    CHECK(error.find('\n') == std::string::npos);
  }
  CHECK(mentions(bag_error(whole.substr(0, 9000)), "is truncated: its index should be at byte"));
  CHECK(mentions(bag_error(whole.substr(0, 9000)), "rosbag reindex"));
  CHECK(mentions(bag_error(""), "is no ROS 1 bag"));
  CHECK(mentions(bag_error("#ROSBAG V1.2\n"), "another version than 2.0"));
}

TEST_CASE("a bag that was not closed, is encrypted, or is damaged says so") {
  const std::string whole = small_bag().bytes();
  const auto index_at = whole.find("index_pos=") + 10;
  std::string open = whole;
  open.replace(index_at, 8, std::string(8, '\0'));
  CHECK(mentions(bag_error(open), "has no index: it was not closed by its writer; `rosbag reindex FILE`"));
  std::string far = whole;
  far.replace(index_at, 8, std::string(8, '\x7F'));
  CHECK(mentions(bag_error(far), "is truncated"));
  CHECK(mentions(bag_error(with(whole, "chunk_count=", "encryptor=a=")), "is encrypted"));
  CHECK(mentions(bag_error(with(whole, "compression=none", "compression=nome")), "neither bz2 nor lz4"));
  CHECK(mentions(bag_error(with(whole, "compression=none", "compression=bz2 ")), "neither bz2 nor lz4"));
  CHECK(mentions(bag_error(with(whole, "conn_count=\x05", "conn_count=\x06")), "5 of 6 connections"));
}

TEST_CASE("bags with any bytes changed are read or refused, and decoded or refused") {
  const std::string whole = small_bag().bytes();
  Rng rng("damaged bags");
  std::size_t refused = 0;
  for (int k = 0; k < 400; ++k) {
    std::string damaged = whole;
    for (int n = rng.integer(1, 6); n > 0; --n)
      damaged[static_cast<std::size_t>(rng.integer(0, static_cast<int>(whole.size()) - 1))] =
          static_cast<char>(k % 2 == 0 ? 0xFF : rng.integer(0, 255));
    const std::string error = error_of([&] {
      const bag::BagFile file = bag_of(damaged);
      for (const bag::ImageTopic& topic : bag::survey(file).images) {
        for (const bag::Shot& shot : topic.shots) {
          const auto bytes = file.read(shot.place);
          if (topic.compressed)
            (void)bag::decode_depth(bag::parse_compressed_image(bytes, "d"), true, "d");
          else
            (void)bag::decode_colour(bag::parse_image(bytes, "c"), false, "c");
        }
      }
    });
    refused += error.empty() ? 0 : 1;
  }
  CHECK(refused > 20);
  CHECK(refused < 380);
}

TEST_CASE("damaged chunks, and chunks in a way that this build lacks, are refused") {
  const std::vector<std::uint8_t> rubbish(100, 42);
  for (const char* compression : {"bz2", "lz4"}) {
    const std::string error = error_of([&] { (void)bag::decompress(compression, rubbish, 1000, "chunk"); });
    if (bag::can_decompress(compression))
      CHECK(mentions(error, "data cannot be decompressed"));
    else
      CHECK(mentions(error, "built without: build it where lib"));
    CHECK_FALSE(error_of([&] { (void)bag::decompress(compression, {}, 0, "chunk"); }).empty());
    CHECK_FALSE(error_of([&] { (void)bag::decompress(compression, rubbish, ~0U, "chunk"); }).empty());
  }
}

TEST_CASE("images of every encoding") {
  const cv::Mat bgr(2, 3, CV_8UC3, cv::Scalar(1, 2, 3)), four(2, 3, CV_8UC4, cv::Scalar(1, 2, 3, 4));
  const cv::Mat grey(2, 3, CV_8UC1, cv::Scalar(9));
  const auto colour = [](const char* encoding, const cv::Mat& image) {
    const auto bytes = vector_of(image_message(5, "f", encoding, image));
    return bag::decode_colour(image_of(bytes), false, "c").at<cv::Vec3b>(1, 2);
  };
  CHECK(colour("bgr8", bgr) == cv::Vec3b(1, 2, 3));
  CHECK(colour("rgb8", bgr) == cv::Vec3b(3, 2, 1));
  CHECK(colour("8UC3", bgr) == cv::Vec3b(1, 2, 3));
  CHECK(colour("bgra8", four) == cv::Vec3b(1, 2, 3));
  CHECK(colour("rgba8", four) == cv::Vec3b(3, 2, 1));
  CHECK(colour("mono8", grey) == cv::Vec3b(9, 9, 9));
  CHECK(bag::kind_of("bayer_rggb8", false) == bag::ImageKind::not_understood);
  CHECK(bag::kind_of("jpeg", true) == bag::ImageKind::colour);
  CHECK(bag::kind_of("mono16", false) == bag::ImageKind::sixteen_bit);

  // Rows may be longer than their pixels, and numbers may have their high byte first.
  Serialised padded;
  padded.header(5, "f").u32(2).u32(2).text("16UC1").number(1, 1).u32(6).text(
      std::string("\x05\xDC\x00\x00--\x00\x01\x01\x00--", 12));
  const auto bytes = vector_of(padded.bytes());
  const cv::Mat depth = bag::decode_depth(image_of(bytes), false, "d");
  CHECK(depth.at<std::uint16_t>(0, 0) == 1500);
  CHECK(depth.at<std::uint16_t>(1, 0) == 1);
  CHECK(depth.at<std::uint16_t>(1, 1) == 256);
}

TEST_CASE("depth in metres: what is none, and inverse depth in a PNG") {
  cv::Mat metres(1, 5, CV_32FC1);
  const float values[] = {1.5F, 0.0F, -1.0F, INFINITY, NAN};
  for (int u = 0; u < 5; ++u) metres.at<float>(0, u) = values[u];
  const auto raw = vector_of(image_message(5, "f", "32FC1", metres));
  const cv::Mat depth = bag::decode_depth(image_of(raw), false, "d");
  CHECK(depth.at<float>(0, 0) == 1.5F);
  for (int u = 1; u < 5; ++u) CHECK(std::isnan(depth.at<float>(0, u)));

  // As compressed_depth_image_transport has it: value = a / depth + b, 0 = none.
  const float a = 100 * (100 + 1), b = 1 - a / 10;
  cv::Mat inverse(1, 3, CV_16UC1);
  const float truth[] = {0.8F, 2.0F, 9.9F};
  for (int u = 0; u < 3; ++u) inverse.at<std::uint16_t>(0, u) = std::uint16_t(a / truth[u] + b);
  inverse.at<std::uint16_t>(0, 2) = 0;
  const auto message = [&](const std::string& format, const std::string& data) {
    const auto bytes = vector_of(compressed_message(5, "f", format, data));
    return bag::decode_depth(bag::parse_compressed_image(bytes, "d"), true, "d");
  };
  const cv::Mat found = message("32FC1; compressedDepth png", depth_header(a, b) + png(inverse));
  CHECK(found.at<float>(0, 0) == doctest::Approx(0.8).epsilon(1e-3));
  CHECK(found.at<float>(0, 1) == doctest::Approx(2.0).epsilon(1e-3));
  CHECK(std::isnan(found.at<float>(0, 2)));
  CHECK(message("16UC1; compressedDepth", depth_header(0, 0) + png(inverse)).type() == CV_16UC1);
  CHECK(mentions(error_of([&] { message("16UC1; compressedDepth rvl", depth_header(0, 0)); }), "PNG is"));
  CHECK(mentions(error_of([&] { message("16UC1; compressedDepth", "short"); }), "is too short"));
  CHECK(mentions(error_of([&] { message("16UC1; compressedDepth", depth_header(0, 0) + "no png"); }),
                 "neither PNG"));
}

TEST_CASE("messages that end too early or lie about their sizes are refused by name and byte") {
  const std::string whole = image_message(5, "f", "rgb8", cv::Mat(4, 4, CV_8UC3, cv::Scalar::all(0)));
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const auto bytes = vector_of(whole.substr(0, size));
    CHECK(mentions(error_of([&] { (void)image_of(bytes); }), "image: the message ends at byte"));
  }
  const auto info = info_message(5, "f", {});
  for (std::size_t size = 0; size < info.size(); ++size) {
    const auto bytes = vector_of(info.substr(0, size));
    CHECK(mentions(error_of([&] { (void)bag::parse_camera_info(bytes, "info"); }), "info: "));
  }
  const auto decode = [](std::uint32_t width, std::uint32_t height, std::uint32_t step,
                         const char* encoding) {
    const auto bytes = vector_of(Serialised()
                                     .header(5, "f")
                                     .u32(height)
                                     .u32(width)
                                     .text(encoding)
                                     .number(0, 1)
                                     .u32(step)
                                     .text(std::string(48, 'x'))
                                     .bytes());
    return error_of([&] { (void)bag::decode_colour(image_of(bytes), false, "c"); });
  };
  CHECK(decode(4, 4, 12, "rgb8").empty());
  CHECK(mentions(decode(4, 5, 12, "rgb8"), "5 rows of 12 bytes were expected, the image has 48"));
  CHECK(mentions(decode(4, 4, 11, "rgb8"), "a row of 11 bytes holds no 4 pixels"));
  CHECK(mentions(decode(0, 4, 12, "rgb8"), "is 0x4 pixels"));
  CHECK(mentions(decode(~0U, ~0U, ~0U, "rgb8"), "at most 8192"));
  CHECK(mentions(decode(4, 4, 12, "yuv422"), "'yuv422' is no encoding of a colour image"));
  const auto late = vector_of(Serialised().u32(0).u32(1).u32(1000000000U).text("f").bytes());
  CHECK(mentions(error_of([&] { (void)bag::parse_image_head(late, false, "c"); }), "1000000000 nanoseconds"));
}
