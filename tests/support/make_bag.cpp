// SPDX-License-Identifier: BSD-3-Clause
// Writes a sequence in a folder as a bag, for the example that reads one: make_bag SEQ FILE.bag
#include <cmath>
#include <cstdio>
#include <exception>
#include <fstream>

#include "bag_writer.hpp"
#include "dynslam/runtime/io/frame_stream.hpp"
#include "dynslam/runtime/io/sequence.hpp"

int main(int argc, char** argv) try {
  using namespace dynslam;
  if (argc != 3) return std::puts("usage: make_bag SEQ FILE.bag"), 2;
  const runtime::Sequence sequence = runtime::load_sequence(argv[1]);
  const runtime::CameraConfig camera = camera_of(sequence);
  const auto& k = camera.model.pinhole();
  test::InfoOfCamera info;
  info.width = camera.width;
  info.height = camera.height;
  info.k = info.p = {k.fx(), k.fy(), k.cx(), k.cy()};
  test::BagWriter bag;
  const auto nanoseconds = [](double t) { return std::uint64_t(std::llround(t * 1e6)) * 1000U; };
  for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
    const runtime::RgbdFrame frame = runtime::decode_frame(sequence.frames[i], i, camera);
    const std::uint64_t t = nanoseconds(frame.t), t_depth = nanoseconds(frame.t + frame.depth_delay);
    bag.add("/camera/rgb/image_color", "sensor_msgs/Image", t,
            test::image_message(t, "optical", "bgr8", frame.bgr));
    bag.add("/camera/rgb/camera_info", "sensor_msgs/CameraInfo", t, test::info_message(t, "optical", info));
    bag.add("/camera/depth/image", "sensor_msgs/Image", t_depth,
            test::image_message(t_depth, "optical", "32FC1", frame.depth));
    if (i >= sequence.groundtruth.size()) continue;
    const auto& pose = sequence.groundtruth[i];
    bag.add("/tf", "tf/tfMessage", nanoseconds(pose.t),
            test::tf_message(nanoseconds(pose.t), {{"/world", "/optical", pose.T_w_c}}));
  }
  std::ofstream out(argv[2], std::ios::binary);
  out << bag.bytes();
  return out.flush() ? 0 : 1;
} catch (const std::exception& error) {
  return std::fprintf(stderr, "%s\n", error.what()), 1;
}
