// SPDX-License-Identifier: BSD-3-Clause
// A small recording of ROS 2: 64x64 images, camera, poses, and a topic that no sequence is made of.
#pragma once

#include "bag_fixture.hpp"
#include "mcap_writer.hpp"
#ifdef DYNSLAM_TEST_SQLITE3
#include "db3_writer.hpp"
#endif

namespace dynslam::test {

inline constexpr int kSmallFrames = 5;

/// @param first, end  frames 1, 2, ..., of a recording that is split
template <class Writer>
Writer small_recording(Wire wire = Wire::cdr_little, int first = 1, int end = kSmallFrames + 1) {
  Writer writer;
  const cv::Mat colour(64, 64, CV_8UC3, cv::Scalar(10, 20, 30)), depth(64, 64, CV_16UC1, cv::Scalar(1500));
  InfoOfCamera camera;
  camera.width = camera.height = 64;
  camera.k = {60, 60, 32, 32};
  for (int k = first; k < end; ++k) {
    const std::uint64_t t = std::uint64_t(k) * 100000000U;
    writer.add("/c", "sensor_msgs/Image", t, image_message(t, "f", "rgb8", colour, wire));
    writer.add("/camera_info", "sensor_msgs/CameraInfo", t, info_message(t, "f", camera, wire));
    writer.add("/d/compressed", "sensor_msgs/CompressedImage", t,
               compressed_message(t, "f", "16UC1; png compressed", png(depth), wire));
    writer.add("/tf", "tf/tfMessage", t,
               tf_message(t, {{"w", "f", SE3<double>(SO3<double>(), Eigen::Vector3d(k, 0, 0))}}, wire));
    writer.add("/talk", "std_msgs/String", t, Serialised(wire).text("hello").bytes());
  }
  return writer;
}

}  // namespace dynslam::test
