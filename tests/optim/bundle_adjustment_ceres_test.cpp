// SPDX-License-Identifier: BSD-3-Clause
// Ceres as an independent oracle of bundle adjustment: same residuals, same loss, same minimum.
#include "ceres_bundle.hpp"  // first: see there

#ifdef DYNSLAM_HAVE_CERES
#include "bundle_window.hpp"
#include "random.hpp"

using namespace dynslam;

TEST_CASE("the final cost is Ceres' on the same windows") {
  test::Rng rng("bundle ceres");
  for (int trial = 0; trial < 4; ++trial) {
    CAPTURE(trial);
    test::Window w = test::make_window(rng, 6 + 2 * trial, 150, 0.05);
    const double oracle = test::ceres_bundle_cost(test::kFreiburg3, w.problem(), 5);
    BundleWorkspace<double> workspace;
    BundleOptions<double> options;
    options.max_iterations = 100;
    options.tolerance = 1e-12;
    const auto result = bundle_adjust<double>(test::kFreiburg3, w.problem(), options,
                                              TDistribution<double>::with_dimension(5, 1), workspace);
    CHECK(result.status == BundleStatus::converged);
    CHECK(result.final_cost == doctest::Approx(oracle).epsilon(1e-6));
    CHECK(w.pose_error() < 0.01);
  }
}
#else
DYNSLAM_SKIP_WITHOUT_CERES("the final cost is Ceres' on the same windows")
#endif
