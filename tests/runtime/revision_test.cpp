// SPDX-License-Identifier: BSD-3-Clause
// The next frame tells how the camera moved while one was read row by row, and where it was.
#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <optional>

#include "dynslam/runtime/slam.hpp"
#include "rendered_sequence.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

/// A camera that turns while it reads its rows.
const test::RenderedSequence& turning_camera() {
  static const test::RenderedSequence rendered([] {
    SynthOptions scene;
    scene.scenario = "empty";
    scene.path = "rpy";
    scene.seed = 2;
    scene.frames = 120;
    scene.readout_time = 0.024;
    scene.width = 320;
    scene.height = 240;
    return scene;
  }());
  return rendered;
}

constexpr std::size_t kStep = 3;  // every third image is taken

struct Revisions {
  std::size_t count = 0;
  std::size_t images = 0;
  double as_tracked = 0, revised = 0;  // sums of squared errors [m^2]
};

Revisions revisions(const CameraConfig& camera, const TrackerOptions& tracker) {
  const test::RenderedSequence& o = turning_camera();
  SlamOptions options;
  options.dynamics = DynamicsMode::none;
  options.map = false;
  options.trajectory.smooth = false;
  options.tracker = tracker;
  Slam slam(camera, options);
  Revisions result;
  SE3<double> before;
  for (std::size_t i = 0; i < o.size(); i += kStep, ++result.images) {
    const TrackResult tracked = slam.track(decode_frame(o.sequence.frames[i], i, camera), std::nullopt);
    REQUIRE(tracked.ok());
    if (tracked.revised) {
      ++result.count;
      const std::size_t last = i - kStep;
      CHECK(tracked.revised->t == o.sequence.frames[last].t_rgb);
      const SE3<double> T_w_c =
          (tracked.revised->T_c_reference * slam.map().pose(tracked.revised->reference)).inverse();
      // It is what the trajectory has.
      CHECK((slam.trajectory()[result.images - 1].T_w_c.inverse() * T_w_c).log().norm() < 1e-9);
      const auto squared_error = [&](const SE3<double>& pose) { return std::pow(o.error(last, pose), 2); };
      result.as_tracked += squared_error(before);
      result.revised += squared_error(T_w_c);
    }
    before = tracked.T_w_c;
  }
  CHECK(slam.trajectory().size() == result.images);
  return result;
}

}  // namespace

TEST_CASE("a frame that was read row by row is placed better once the next one has come") {
  const Revisions o = revisions(turning_camera().camera, {});
  CHECK(o.count >= o.images - 3);  // not the first ones, nor the last
  CAPTURE(o.as_tracked);
  CAPTURE(o.revised);
  CHECK(o.revised < 0.95 * o.as_tracked);
}

TEST_CASE("nothing is placed twice where rows are read at once, by the paper's method, or when told not to") {
  CameraConfig global = turning_camera().camera;
  global.readout_time = 0;
  CHECK(revisions(global, {}).count == 0);
  TrackerOptions off;
  off.search.revise = false;
  CHECK(revisions(turning_camera().camera, off).count == 0);
  TrackerOptions paper;
  paper.method = MotionMethod::paper;
  CHECK(revisions(turning_camera().camera, paper).count == 0);
}
