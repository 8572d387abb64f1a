// SPDX-License-Identifier: BSD-3-Clause
// Frames that were lost get their poses once the camera is known on both sides of the loss.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

#include "dynslam/runtime/slam.hpp"
#include "rendered_sequence.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

constexpr int kCarriedFrames = 40, kLostFrames = 6;

struct Loss {
  std::size_t first = 18, frames = kLostFrames;
};

/// A camera that is carried through an office where nothing moves.
const test::RenderedSequence& carried_camera() {
  static const test::RenderedSequence rendered([] {
    SynthOptions scene;
    scene.scenario = "empty";
    scene.path = "xyz";
    scene.seed = 4;
    scene.frames = kCarriedFrames;
    return scene;
  }());
  return rendered;
}

/// Something that is held before the lens and leaves a part of the view open.
void cover_all_but(RgbdFrame& frame, const cv::Rect& open) {
  cv::Mat covered(frame.gray.size(), CV_8UC1, cv::Scalar(255));
  covered(open).setTo(0);
  frame.gray.setTo(30, covered);
  frame.bgr.setTo(cv::Scalar::all(30), covered);
  frame.depth.setTo(std::numeric_limits<double>::quiet_NaN(), covered);
}

struct Recovery {
  std::vector<std::size_t> lost;         // when they came
  std::vector<RecoveredPose> recovered;  // told by the frame after them
  std::vector<StampedPose<double>> trajectory;
};

/// @param open  what is seen of the covered frames
Recovery recovery(const cv::Rect& open, std::size_t recovered_frames, MotionMethod method = MotionMethod::full,
                  const Loss& loss = {}) {
  const test::RenderedSequence& o = carried_camera();
  SlamOptions options;
  options.dynamics = DynamicsMode::none;
  options.map = false;
  options.tracker.method = method;
  options.tracker.search.recovered_frames = recovered_frames;
  Slam slam(o.camera, options);
  Recovery result;
  for (std::size_t i = 0; i < kCarriedFrames; ++i) {
    RgbdFrame frame = o.frame(i);
    if (i >= loss.first && i < loss.first + loss.frames) cover_all_but(frame, open);
    const TrackResult tracked = slam.track(frame, std::nullopt);
    if (!tracked.ok()) result.lost.push_back(i);
    if (!tracked.recovered.empty()) {
      CHECK(tracked.ok());
      CHECK(i == result.lost.back() + 1);
      result.recovered = tracked.recovered;
    }
  }
  slam.finish();
  result.trajectory = slam.trajectory();
  return result;
}

/// Too little to be located by as it comes.
const cv::Rect kGlimpse(0, 100, 120, 200);

/// The recovered frames stand in the trajectory, where the camera was to within `bound` [m].
void check_recovered(const Recovery& o, double bound) {
  CHECK(o.trajectory.size() == kCarriedFrames - o.lost.size() + o.recovered.size());
  for (std::size_t i = 1; i < o.trajectory.size(); ++i) CHECK(o.trajectory[i - 1].t < o.trajectory[i].t);
  std::size_t found = 0;
  for (std::size_t i = 0; i < kCarriedFrames; ++i) {
    const double t = carried_camera().sequence.frames[i].t_rgb;
    const auto pose = std::find_if(o.trajectory.begin(), o.trajectory.end(),
                                   [t](const StampedPose<double>& p) { return std::abs(p.t - t) < 1e-6; });
    if (pose == o.trajectory.end()) continue;
    const bool lost = std::find(o.lost.begin(), o.lost.end(), i) != o.lost.end();
    CHECK(carried_camera().error(i, pose->T_w_c) < (lost ? bound : 0.003));
    found += lost ? 1U : 0U;
  }
  CHECK(found == o.recovered.size());
}

}  // namespace

TEST_CASE("frames of which little is seen are found when the camera is known on both sides of them") {
  const Recovery o = recovery(kGlimpse, PoseSearchOptions().recovered_frames);
  REQUIRE(o.lost.size() == kLostFrames);
  REQUIRE(o.recovered.size() >= kLostFrames - 1);
  check_recovered(o, 0.005);
}

TEST_CASE("over a long loss, too, which the motion before it does not tell") {
  const Loss loss{10, 19};
  const Recovery o =
      recovery(cv::Rect(500, 100, 120, 150), PoseSearchOptions().recovered_frames, MotionMethod::full, loss);
  REQUIRE(o.lost.size() == loss.frames);
  CHECK(o.recovered.size() + 1 >= loss.frames);  // 17 with the curve alone
  check_recovered(o, 0.01);
}

TEST_CASE("poses are never made up: of frames that show nothing there is none") {
  const Recovery o = recovery(cv::Rect(0, 0, 1, 1), PoseSearchOptions().recovered_frames);
  CHECK(o.lost.size() >= kLostFrames);
  CHECK(o.recovered.empty());
  CHECK(o.trajectory.size() == kCarriedFrames - o.lost.size());
}

TEST_CASE("a loss of more frames than are kept stays one, as does each with the paper's method") {
  for (const std::size_t kept : {std::size_t(0), std::size_t(kLostFrames - 1)}) {
    const Recovery o = recovery(kGlimpse, kept);
    CHECK(o.lost.size() == kLostFrames);
    CHECK(o.recovered.empty());
    CHECK(o.trajectory.size() == kCarriedFrames - kLostFrames);
  }
  const Recovery paper = recovery(kGlimpse, PoseSearchOptions().recovered_frames, MotionMethod::paper);
  CHECK(paper.lost.size() >= kLostFrames);
  CHECK(paper.recovered.empty());
}
