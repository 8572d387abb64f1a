// SPDX-License-Identifier: BSD-3-Clause
// The short rendered film of the formats' fixtures, as a bag.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <utility>
#include <vector>

#include "bag_writer.hpp"
#include "format_fixtures.hpp"

namespace dynslam::test {

inline constexpr const char* kColourTopic = "/camera/rgb/image_color";
inline constexpr const char* kDepthTopic = "/camera/depth/image";
inline constexpr const char* kInfoTopic = "/camera/rgb/camera_info";
inline constexpr const char* kOpticalFrame = "/openni_rgb_optical_frame";

/// Nanoseconds of the k-th frame: those of the other fixtures' stamps, 100.0, 100.1, ...
inline std::uint64_t bag_time(std::size_t k) {
  return 100000000000U + k * 100000000U;
}

inline std::string png(const cv::Mat& image) {
  std::vector<std::uint8_t> bytes;
  cv::imencode(".png", image, bytes);
  return {bytes.begin(), bytes.end()};
}

inline std::string jpeg(const cv::Mat& image) {
  std::vector<std::uint8_t> bytes;
  cv::imencode(".jpg", image, bytes, {cv::IMWRITE_JPEG_QUALITY, 98});
  return {bytes.begin(), bytes.end()};
}

inline cv::Mat in_metres(const cv::Mat& depth) {
  cv::Mat metres;
  depth.convertTo(metres, CV_32FC1, 1 / 5000.0);
  metres.setTo(std::nan(""), depth == 0);
  return metres;
}

inline cv::Mat in_millimetres(const cv::Mat& depth) {
  cv::Mat mm;
  depth.convertTo(mm, CV_16UC1, 1 / 5.0);
  return mm;
}

/// compressed_depth_image_transport's header: its format, and the two numbers of inverse depth.
inline std::string depth_header(float a, float b) {
  return Serialised()
      .u32(1)
      .u32(std::bit_cast<std::uint32_t>(a))
      .u32(std::bit_cast<std::uint32_t>(b))
      .bytes();
}

/// A topic of the bag: its message for a shot.
struct TopicOfFilm {
  std::string name, type;
  std::function<std::string(std::uint64_t t, const Shot&)> message;
};

inline TopicOfFilm raw_colour(std::string name = kColourTopic, Wire wire = Wire::ros1) {
  return {std::move(name), "sensor_msgs/Image", [wire](std::uint64_t t, const Shot& shot) {
            return image_message(t, kOpticalFrame, "bgr8", shot.bgr, wire);
          }};
}
inline TopicOfFilm compressed_colour(Wire wire = Wire::ros1) {
  return {std::string(kColourTopic) + "/compressed", "sensor_msgs/CompressedImage",
          [wire](std::uint64_t t, const Shot& shot) {
            return compressed_message(t, kOpticalFrame, "rgb8; jpeg compressed bgr8", jpeg(shot.bgr), wire);
          }};
}
inline TopicOfFilm metric_depth(std::string name = kDepthTopic, Wire wire = Wire::ros1) {
  return {std::move(name), "sensor_msgs/Image", [wire](std::uint64_t t, const Shot& shot) {
            return image_message(t, kOpticalFrame, "32FC1", in_metres(shot.depth), wire);
          }};
}
inline TopicOfFilm millimetre_depth(std::string name = kDepthTopic) {
  return {std::move(name), "sensor_msgs/Image", [](std::uint64_t t, const Shot& shot) {
            return image_message(t, kOpticalFrame, "16UC1", in_millimetres(shot.depth));
          }};
}
inline TopicOfFilm compressed_depth(Wire wire = Wire::ros1) {
  return {std::string(kDepthTopic) + "/compressedDepth", "sensor_msgs/CompressedImage",
          [wire](std::uint64_t t, const Shot& shot) {
            return compressed_message(t, kOpticalFrame, "16UC1; compressedDepth",
                                      depth_header(0, 0) + png(in_millimetres(shot.depth)), wire);
          }};
}
inline TopicOfFilm camera_info(const InfoOfCamera& camera = {}, Wire wire = Wire::ros1) {
  return {kInfoTopic, "sensor_msgs/CameraInfo", [camera, wire](std::uint64_t t, const Shot&) {
            return info_message(t, kOpticalFrame, camera, wire);
          }};
}
/// As in TUM's bags: what is tracked moves in the world, and the camera stands still on it.
inline TopicOfFilm tf_truth(Wire wire = Wire::ros1) {
  return {"/tf", "tf/tfMessage", [wire](std::uint64_t t, const Shot& shot) {
            const SE3<double> T_k_c(Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5),
                                    Eigen::Vector3d(0, -0.02, 0.01));
            const SE3<double> T_c_o(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.03, 0, 0));
            return tf_message(t,
                              {{"/world", "/kinect", shot.T_w_c * (T_k_c * T_c_o).inverse()},
                               {"/kinect", "/openni_camera", T_k_c},
                               {"/openni_camera", kOpticalFrame, T_c_o}},
                              wire);
          }};
}

/// @param first, end  frames of the film
template <class Writer = BagWriter>
Writer bag_of_film(const std::vector<TopicOfFilm>& topics, std::size_t first = 0, std::size_t end = 1000) {
  Writer bag;
  for (std::size_t k = first; k < std::min(end, film().size()); ++k) {
    for (const TopicOfFilm& topic : topics)
      bag.add(topic.name, topic.type, bag_time(k), topic.message(bag_time(k), film()[k]));
  }
  return bag;
}

}  // namespace dynslam::test
