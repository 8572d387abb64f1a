// SPDX-License-Identifier: BSD-3-Clause
//
// Example 10: a camera at 30 Hz that waits for nobody. Usage: example_10_live_camera SEQUENCE OUT
// A sequence stands for the camera. Late frames are dropped; how many, and how late the others are, is printed.
#include <chrono>
#include <cstdio>
#include <dynslam/runtime/io/sequence.hpp>
#include <dynslam/runtime/io/trajectory_io.hpp>
#include <dynslam/runtime/live.hpp>
#include <filesystem>
#include <future>
#include <opencv2/imgcodecs.hpp>
#include <thread>

namespace rt = dynslam::runtime;

int main(int argc, char** argv) try {
  if (argc != 3) return std::puts("usage: example_10_live_camera SEQUENCE OUT"), 2;
  const auto sequence = rt::load_sequence(argv[1]);

  rt::SlamOptions options;  // told on the thread that tracks
  options.events.lost = [](const rt::LostEvent& e) { std::printf("lost at %.3f s\n", e.t); };
  options.events.found = [](const rt::FoundEvent& e) { std::printf("found at %.3f s\n", e.t); };
  options.events.loop = [](const rt::LoopEvent& e) { std::printf("loop at %.3f s\n", e.t); };
  rt::LiveOptions live;
  double newest = 0;
  bool in_order = true;
  live.result = [&](const rt::LiveResult& r) {  // a robot would publish r.track.T_w_c here
    in_order = in_order && r.t > newest;
    newest = r.t;
  };
  rt::LiveSlam slam(camera_of(sequence), options, live);

  auto camera = std::async(std::launch::async, [&] {
    auto due = std::chrono::steady_clock::now();
    for (const auto& f : sequence.frames) {
      const cv::Mat bgr = cv::imread(f.rgb.string()),
                    depth = cv::imread(f.depth.string(), cv::IMREAD_UNCHANGED);
      std::this_thread::sleep_until(due += std::chrono::microseconds(33333));
      slam.push(bgr, depth, f.t_rgb, f.t_depth - f.t_rgb);  // returns at once; throws what the tracking met
    }
  });
  camera.get();
  slam.finish();

  const rt::LiveStatistics s = slam.statistics();
  std::printf("%zu frames: %zu tracked, %zu lost, %zu dropped; latency median %.1f, 95 %% %.1f, max %.1f ms\n",
              s.pushed, s.tracked, s.lost, s.dropped, 1e3 * s.latency_median, 1e3 * s.latency_p95,
              1e3 * s.latency_max);
  std::filesystem::create_directories(argv[2]);
  const auto trajectory = slam.slam().trajectory();
  rt::write_trajectory(std::filesystem::path(argv[2]) / "trajectory.txt", trajectory);
  const bool all = s.pushed == sequence.frames.size() && s.pushed == s.tracked + s.lost + s.dropped;
  return all && in_order && s.tracked > 0 && trajectory.size() == s.tracked ? 0 : 1;
} catch (const std::exception& error) {
  return std::fprintf(stderr, "%s\n", error.what()), 1;
}
