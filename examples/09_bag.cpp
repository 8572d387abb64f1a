// SPDX-License-Identifier: BSD-3-Clause
//
// Example 9: a ROS 1 bag, as it was recorded. Usage: example_09_bag FILE.bag OUT [COLOUR,DEPTH]
// The two topics need naming only where the bag has several that may be meant. The trajectory is that of
// `dynslam run FILE.bag --out OUT --dynamics geometric`, byte for byte.
#include <cstdio>
#include <dynslam/runtime/io/frame_stream.hpp>
#include <dynslam/runtime/io/trajectory_io.hpp>
#include <dynslam/runtime/slam.hpp>
#include <filesystem>

int main(int argc, char** argv) try {
  if (argc != 3 && argc != 4) return std::puts("usage: example_09_bag FILE.bag OUT [COLOUR,DEPTH]"), 2;
  dynslam::runtime::SequenceOptions options;
  if (argc == 4) options.topics = argv[3];
  const auto bag = dynslam::runtime::load_sequence(argv[1], options);  // places of the images, not the images
  const auto camera = camera_of(bag);                                  // CameraInfo beside the colour topic
  std::printf("%zu frames of %s, %dx%d\n", bag.frames.size(), bag.topics.c_str(), camera.width,
              camera.height);

  dynslam::runtime::Slam slam(camera);
  dynslam::runtime::FrameStream frames(bag, camera);  // decoded ahead, on a thread of its own
  while (const auto next = frames.next()) {
    if (!next->frame) std::printf("left out: %s\n", next->error.c_str());
    if (next->frame && !slam.track(*next->frame).ok())
      std::printf("lost at %s s\n", next->record.stamp.c_str());
  }
  slam.finish();
  std::filesystem::create_directories(argv[2]);
  dynslam::runtime::write_trajectory(std::filesystem::path(argv[2]) / "trajectory.txt", slam.trajectory());
  return slam.trajectory().empty() ? 1 : 0;
} catch (const std::exception& error) {
  return std::fprintf(stderr, "%s\n", error.what()), 1;
}
