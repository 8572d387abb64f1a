// SPDX-License-Identifier: BSD-3-Clause
// Ceres beside doctest. Include this before anything else: glog, which Ceres brings, defines CHECK, too,
// and its version aborts the program.
#pragma once

#ifdef DYNSLAM_HAVE_CERES
#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <cmath>

#undef CHECK
#undef CHECK_EQ
#undef CHECK_NE
#undef CHECK_LT
#undef CHECK_GT
#undef CHECK_LE
#undef CHECK_GE

namespace dynslam::test {

/// The loss of a t-distribution: rho(s) = numerator log(1 + s / nu). Ceres minimises half of the sum of rho.
struct TLoss : ceres::LossFunction {
  double nu = 5, numerator = 6;
  void Evaluate(double s, double out[3]) const override {
    out[0] = numerator * std::log1p(s / nu);
    out[1] = numerator / (nu + s);
    out[2] = -numerator / ((nu + s) * (nu + s));
  }
};

}  // namespace dynslam::test
#endif

#include <doctest/doctest.h>

/// Stands for the cases of a file that need Ceres where it is missing. A file of such cases ends in
/// _ceres_test.cpp and has no others: ctest reports it as skipped by this message.
#define DYNSLAM_SKIP_WITHOUT_CERES(name)     \
  TEST_CASE(name) {                          \
    MESSAGE("SKIPPED: built without Ceres"); \
  }
