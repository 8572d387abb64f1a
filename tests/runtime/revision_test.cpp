// SPDX-License-Identifier: BSD-3-Clause
// The next frame tells how the camera moved while one was read row by row, and where it was.
#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <vector>

#include "dynslam/runtime/io/trajectory_io.hpp"
#include "dynslam/runtime/io/tum_reader.hpp"
#include "dynslam/runtime/slam.hpp"
#include "dynslam/runtime/synth/synth.hpp"
#include "tum_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

/// A camera that turns while it reads its rows, of which every third image is taken.
struct TurningCamera {
  test::TemporaryFolder folder;
  Sequence sequence;
  CameraConfig camera;
  std::vector<StampedPose<double>> truth;
  std::vector<std::size_t> images;

  TurningCamera() {
    SynthOptions scene;
    scene.scenario = "empty";
    scene.path = "rpy";
    scene.seed = 2;
    scene.frames = 120;
    scene.readout_time = 0.024;
    scene.width = 320;
    scene.height = 240;
    synthesize(scene, folder.path);
    sequence = load_sequence(folder.path);
    camera = load_camera((folder.path / "camera.txt").string());
    truth = read_trajectory(folder.path / "groundtruth.txt");
    for (std::size_t i = 0; i < sequence.frames.size(); i += 3) images.push_back(i);
  }
  /// Squared error of a pose of image i, beside where the first was [m^2].
  [[nodiscard]] double squared_error(std::size_t i, const SE3<double>& T_w_c) const {
    const SE3<double> T_first_c = truth.front().T_w_c.inverse() * truth[i].T_w_c;
    return (T_first_c.inverse() * T_w_c).translation().squaredNorm();
  }
};

const TurningCamera& turning_camera() {
  static const TurningCamera rendered;
  return rendered;
}

struct Revisions {
  std::size_t count = 0;
  double as_tracked = 0, revised = 0;  // mean squared errors [m^2]
};

Revisions revisions(const CameraConfig& camera, const TrackerOptions& tracker) {
  const TurningCamera& o = turning_camera();
  SlamOptions options;
  options.dynamics = DynamicsMode::none;
  options.map = false;
  options.trajectory.smooth = false;
  options.tracker = tracker;
  Slam slam(camera, options);
  Revisions result;
  SE3<double> before;
  for (std::size_t k = 0; k < o.images.size(); ++k) {
    const std::size_t i = o.images[k];
    const TrackResult tracked = slam.track(decode_frame(o.sequence.frames[i], i, camera), std::nullopt);
    REQUIRE(tracked.ok());
    if (tracked.revised) {
      ++result.count;
      const std::size_t last = o.images[k - 1];
      CHECK(tracked.revised->t == o.sequence.frames[last].t_rgb);
      const SE3<double> T_w_c =
          (tracked.revised->T_c_reference * slam.map().pose(tracked.revised->reference)).inverse();
      // It is what the trajectory has.
      CHECK((slam.trajectory()[k - 1].T_w_c.inverse() * T_w_c).log().norm() < 1e-9);
      result.as_tracked += o.squared_error(last, before);
      result.revised += o.squared_error(last, T_w_c);
    }
    before = tracked.T_w_c;
  }
  CHECK(slam.trajectory().size() == o.images.size());
  return result;
}

}  // namespace

TEST_CASE("a frame that was read row by row is placed better once the next one has come") {
  const Revisions o = revisions(turning_camera().camera, {});
  CHECK(o.count >= turning_camera().images.size() - 3);  // not the first ones, nor the last
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
  paper.method = Method::paper;
  CHECK(revisions(turning_camera().camera, paper).count == 0);
}
