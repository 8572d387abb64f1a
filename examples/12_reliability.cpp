// SPDX-License-Identifier: BSD-3-Clause
//
// Example 12: are the beliefs of MotionSegmenter right? Of the cells that are said to move with a probability of 0.8, 0.8
// should. Usage: example_12_reliability SEQUENCE OUT. Writes OUT.csv, a row per tenth of the probability.
// SEQUENCE has true poses and true masks, as `dynslam synth` makes them (dynamic_mask/). Fails where a tenth that
// has 1 % of the cells is off by more than 0.1.
#include <cstdio>
#include <dynslam/dynamics/motion_segmenter.hpp>
#include <dynslam/eval/reliability.hpp>
#include <dynslam/eval/trajectory.hpp>
#include <dynslam/interop/opencv.hpp>
#include <dynslam/runtime/io/tum_reader.hpp>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <string>

int main(int argc, char** argv) try {
  if (argc != 3) return std::puts("usage: example_12_reliability SEQUENCE OUT"), 2;
  namespace rt = dynslam::runtime;
  const rt::Sequence sequence = rt::load_sequence(argv[1]);
  const rt::CameraConfig camera = rt::load_camera(sequence.camera_hint);
  dynslam::MotionSegmenter<double, dynslam::AnyCamera<double>> segmenter(camera.model);
  dynslam::ReliabilityDiagram diagram;
  for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
    const rt::RgbdFrame frame = rt::decode_frame(sequence.frames[i], i, camera);
    const auto depth = dynslam::interop::view<const float>(frame.depth);
    const auto T_c_w = sequence.groundtruth.at(i).T_w_c.inverse();
    const auto& motion =
        segmenter.segment(dynslam::interop::view<const std::uint8_t>(frame.gray), depth, frame.t, T_c_w);
    const auto file = sequence.root / "dynamic_mask" / (sequence.frames[i].stamp + ".png");
    const cv::Mat truth = cv::imread(file.string(), cv::IMREAD_GRAYSCALE);
    if (truth.empty()) throw std::runtime_error(file.string() + ": no mask");
    for (std::size_t c = 0; i > 3 && c < segmenter.grid().cells(); ++c) {  // at first nothing can be known
      const auto p = segmenter.grid().pixel_of(c);
      if (p.u >= 0 && dynslam::is_valid_depth(depth(p.u, p.v)))
        diagram.add(segmenter.belief().data()[c], truth.at<std::uint8_t>(p.v, p.u) != 0);
    }
    segmenter.remember(T_c_w, motion.mask);
  }
  std::ofstream out(std::string(argv[2]) + ".csv");
  out << "cells,said,moved\n";
  for (std::size_t k = 0; k < 10; ++k) {
    const auto t = diagram.tenth(k);
    out << t.statements << ',' << t.said << ',' << t.happened << '\n';
    std::printf("%8zu cells said to move with %.2f: %.2f do\n", t.statements, t.said, t.happened);
  }
  return diagram.largest_error() <= 0.1 ? 0 : 1;
} catch (const std::exception& error) {
  return std::fprintf(stderr, "%s\n", error.what()), 1;
}
