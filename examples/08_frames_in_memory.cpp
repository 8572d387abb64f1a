// SPDX-License-Identifier: BSD-3-Clause
//
// Example 8: the whole system in a loop over images in memory. Usage: example_08_frames_in_memory SEQUENCE
// OUT The results are those of `dynslam run SEQUENCE --out OUT --dynamics geometric`, byte for byte.
#include <cstdio>
#include <dynslam/runtime/io/sequence.hpp>
#include <dynslam/runtime/io/trajectory_io.hpp>
#include <dynslam/runtime/slam.hpp>
#include <opencv2/imgcodecs.hpp>

int main(int argc, char** argv) try {
  if (argc != 3) return std::puts("usage: example_08_frames_in_memory SEQUENCE OUT"), 2;
  const auto sequence = dynslam::runtime::load_sequence(argv[1]);  // or a camera of yours
  dynslam::runtime::Slam slam(camera_of(sequence));
  for (const auto& f : sequence.frames) {
    const cv::Mat bgr = cv::imread(f.rgb.string()),
                  depth = cv::imread(f.depth.string(), cv::IMREAD_UNCHANGED);
    const auto result = slam.track(bgr, depth, f.t_rgb, std::nullopt, f.t_depth - f.t_rgb);
    if (!result.ok()) std::printf("lost at %.3f s\n", f.t_rgb);
  }
  std::filesystem::create_directories(argv[2]);
  slam.save_octree(argv[2]);  // waits for what is still computed
  dynslam::runtime::write_trajectory(std::filesystem::path(argv[2]) / "trajectory.txt", slam.trajectory());
  return slam.trajectory().empty() ? 1 : 0;
} catch (const std::exception& error) {
  return std::fprintf(stderr, "%s\n", error.what()), 1;
}
