// SPDX-License-Identifier: BSD-3-Clause
// Bundle adjustment of the windows that the tracker meets, against Ceres.
#include "ceres_bundle.hpp"  // first: see there

#include <filesystem>

#include "dynslam/map/bundle_window.hpp"
#include "dynslam/runtime/slam/tracker.hpp"
#include "dynslam/runtime/synth/synth.hpp"
#include "recorded_scans.hpp"
#include "tum_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

TEST_CASE("on the windows of a sequence, bundle adjustment ends at Ceres' cost") {
#ifndef DYNSLAM_HAVE_CERES
  MESSAGE("SKIPPED: built without Ceres");
#else
  constexpr std::size_t kFrames = 199, kWindowsWanted = 5;
  test::TemporaryFolder rendered;
  std::filesystem::path folder = rendered.path;
  if (const auto recorded = test::recorded_sequence("rgbd_dataset_freiburg1_xyz_first200")) {
    folder = *recorded;
  } else {
    MESSAGE("no recorded data (DYNSLAM_DATA): a rendered sequence takes their place");
    SynthOptions synth;
    synth.frames = 40;
    synth.path = "xyz";
    synthesize(synth, folder);
  }
  const Sequence sequence = load_sequence(folder);
  const CameraConfig camera = load_camera(sequence.camera_hint);
  TrackerOptions options;
  options.dynamics = DynamicsMode::geometric;
  Tracker tracker(camera, options);
  const LocalBundleOptions& local = options.local_bundle;
  BundleWindow<double> bundle(local);
  BundleWorkspace<double> workspace;
  BundleOptions<double> solver;
  solver.max_iterations = 200;
  solver.tolerance = 1e-12;
  std::size_t windows = 0, keyframes = 0, observations = 0;
  for (std::size_t k = 0; k < std::min(kFrames, sequence.frames.size()) && windows < kWindowsWanted; ++k) {
    const TrackResult result = tracker.track(decode_frame(sequence.frames[k], k, camera), std::nullopt);
    // Where a keyframe was made, the tracker has just started to adjust this very window. The first ones
    // hold little; where another keyframe serves instead, nothing is adjusted.
    if (!result.keyframe || tracker.map().keyframes().back().culled() || ++keyframes < 3) continue;
    bundle.collect(tracker.map(), options.depth_noise);
    const BundleProblem<double> problem = bundle.problem();
    CAPTURE(k);
    const double oracle = test::ceres_bundle_cost(camera.model.pinhole(), problem, local.nu);
    const auto adjusted =
        bundle_adjust<double>(camera.model.pinhole(), problem, solver,
                              TDistribution<double>::with_dimension(local.nu, 1), workspace);
    CHECK(adjusted.ok());
    CHECK(adjusted.final_cost < adjusted.initial_cost);
    CHECK(adjusted.final_cost == doctest::Approx(oracle).epsilon(1e-6));
    observations += problem.observations.size();
    ++windows;
  }
  REQUIRE(windows >= 3);
  CHECK(observations > 500 * windows);
#endif
}
