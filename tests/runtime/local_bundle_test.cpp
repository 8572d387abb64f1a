// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/local_bundle.hpp"

#include <doctest/doctest.h>

#include "dynslam/robust/t_distribution.hpp"
#include "pose_distance.hpp"
#include "random.hpp"
#include "row_of_keyframes.hpp"

using namespace dynslam;
using dynslam::runtime::LocalBundle, dynslam::runtime::LocalBundleOptions, dynslam::runtime::LocalMap;

namespace {

const Pinhole<double> kWindowCamera(525, 525, 319.5, 239.5);
const DepthNoise<double> kNoise{0.004, 0.008};

}  // namespace

TEST_CASE("the thread's adjustment is that of the window it was started with, whatever happens meanwhile") {
  test::Rng rng("local bundle");
  LocalMap map = test::row_of_keyframes(kWindowCamera, 200, 5, 0.05, rng), expected = map;
  const LocalBundleOptions options;
  LocalBundle bundle(kWindowCamera, options);
  bundle.start(map, kNoise);
  CHECK(bundle.pending());
  const SE3d D = bundle.apply(map);
  CHECK_FALSE(bundle.pending());

  BundleWindow<double> window(options);
  BundleWorkspace<double> workspace;
  window.collect(expected, kNoise);
  REQUIRE(bundle_adjust<double>(kWindowCamera, window.problem(), options.solver,
                                TDistribution<double>::with_dimension(options.nu, 1), workspace)
              .ok());
  const SE3d D_expected = window.apply(kWindowCamera, expected);
  CHECK(test::pose_distance(D, D_expected) == 0);
  for (std::size_t k = 0; k < expected.keyframes().size(); ++k)
    CHECK(test::pose_distance(map.keyframes()[k].frame.T_c_w, expected.keyframes()[k].frame.T_c_w) == 0);
}

TEST_CASE("what a running thread uses cannot be copied or moved away from under it") {
  CHECK_FALSE(std::is_copy_constructible_v<LocalBundle>);
  CHECK_FALSE(std::is_move_constructible_v<LocalBundle>);
  CHECK_FALSE(std::is_move_assignable_v<LocalBundle>);
}
