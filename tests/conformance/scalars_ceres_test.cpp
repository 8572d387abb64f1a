// SPDX-License-Identifier: BSD-3-Clause
#include "ceres_oracle.hpp"

#ifdef DYNSLAM_HAVE_CERES
#include <ceres/jet.h>

#include "scalars.hpp"

using namespace dynslam;

TEST_CASE_TEMPLATE("functions of numbers carry the derivatives of ceres::Jet", Functions,
                   test::CameraFunctions, test::OtherFunctions) {
  using Jet = ceres::Jet<double, 6>;
  test::check_dual_numbers<Functions, Jet>([](int k) { return Jet(0.0, k); },
                                           [](const Jet& x, int k) { return x.v(k); });
}
#else
DYNSLAM_SKIP_WITHOUT_CERES("functions of numbers carry the derivatives of ceres::Jet")
#endif
