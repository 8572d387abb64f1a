// SPDX-License-Identifier: BSD-3-Clause
// A program of another project: frames in memory. Usage: consumer SEQUENCE
#include <dynslam/runtime/io/tum_reader.hpp>
#include <dynslam/runtime/slam.hpp>
#include <opencv2/imgcodecs.hpp>

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const auto sequence = dynslam::runtime::load_sequence(argv[1]);
  dynslam::runtime::Slam slam(dynslam::runtime::camera_of(sequence));
  for (const auto& frame : sequence.frames) {
    const cv::Mat bgr = cv::imread(frame.rgb.string()),
                  depth = cv::imread(frame.depth.string(), cv::IMREAD_UNCHANGED);
    if (!slam.track(bgr, depth, frame.t_rgb).ok()) return 1;
  }
  slam.finish();
  return slam.trajectory().size() == sequence.frames.size() && slam.octree()->size() > 0 ? 0 : 1;
}
