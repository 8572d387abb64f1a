// SPDX-License-Identifier: BSD-3-Clause
// Where features do not lead from one frame to the next, grey values do.
#include <doctest/doctest.h>

#include <algorithm>
#include <cstddef>
#include <optional>
#include <utility>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "dynslam/geometry/se3.hpp"
#include "dynslam/runtime/io/frame_stream.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"
#include "dynslam/runtime/slam/tracker.hpp"
#include "run_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

constexpr std::size_t kClear = 8, kFrames = 40, kStep = 5;
constexpr double kCovered = 0.85;

/// A board of another texture before the left of the view, which moves with the camera; all is a little
/// blurred.
void cover(RgbdFrame& frame) {
  cv::Mat noise(60, 80, CV_8UC1), board;
  cv::RNG(7).fill(noise, cv::RNG::UNIFORM, 0, 255);
  cv::resize(noise, board, frame.gray.size(), 0, 0, cv::INTER_CUBIC);
  const cv::Rect covered(0, 0, static_cast<int>(kCovered * frame.gray.cols), frame.gray.rows);
  board(covered).copyTo(frame.gray(covered));
  frame.depth(covered).setTo(0.8);
  cv::GaussianBlur(frame.gray, frame.gray, {}, 2);
}

}  // namespace

TEST_CASE("a turning camera is not lost when a board comes to hide most of a blurred view") {
  const test::TemporaryFolder folder;
  SynthOptions synth;
  synth.frames = kFrames;
  synth.scenario = "empty";
  synth.path = "rpy";
  synthesize(synth, folder.path / "sequence");
  const Sequence sequence = load_sequence(folder.path / "sequence");
  const CameraConfig camera = load_camera(sequence.camera_hint);
  const auto truth = read_trajectory(folder.path / "sequence" / "groundtruth.txt");
  // Frames that were lost, and how far the others are off at most [m].
  const auto run = [&](bool alignment, double max_turn) {
    TrackerOptions options;
    options.search.max_turn = max_turn;
    options.dynamics = DynamicsMode::geometric;
    options.search.aligned_starts = alignment;
    Tracker tracker(camera, options);
    int lost = 0;
    double worst = 0;
    for (std::size_t i = 0, n = 0; i < kFrames; i += i < kClear ? 1 : kStep, ++n) {
      RgbdFrame frame = decode_frame(sequence.frames[i], n, camera);
      frame.t = static_cast<double>(n) / 30;  // so the turn is five times as fast from the board on
      if (i >= kClear) cover(frame);
      const TrackResult result = tracker.track(frame, std::nullopt);
      lost += result.ok() ? 0 : 1;
      if (!result.ok()) continue;
      const SE3<double> T_w_c = truth[0].T_w_c.inverse() * truth[i].T_w_c;
      worst = std::max(worst, (result.T_w_c.translation() - T_w_c.translation()).norm());
    }
    return std::pair(lost, worst);
  };
  constexpr int kHidden = (kFrames - kClear + kStep - 1) / kStep;
  const double hand = PoseSearchOptions().max_turn;
  CHECK(run(false, hand).first == kHidden);
  CHECK(run(true, 0.05).first == kHidden);  // a turn that this camera cannot make is the board's
  const auto [lost, worst] = run(true, hand);
  CHECK(lost == 0);
  CHECK(worst < 0.2);
}
