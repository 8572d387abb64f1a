// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/dynamics/mask_arbitration.hpp"

#include <doctest/doctest.h>

using namespace dynslam;

namespace {

template <class S>
PoseResult<S> pose(int inliers, double deviation, double shift) {
  PoseResult<S> result;
  result.status = PoseStatus::converged;
  result.inliers = inliers;
  result.covariance.setIdentity();
  result.covariance *= S(deviation * deviation);
  result.T_c_w = SE3<S>(SO3<S>(), Eigen::Matrix<S, 3, 1>(S(shift), S(0), S(0)));
  return result;
}

}  // namespace

TEST_CASE_TEMPLATE("masks are judged by the two poses: how certain, and how far from one another", S, float,
                   double) {
  const auto all = pose<S>(300, 0.001, 0);
  CHECK(arbitrate_mask(pose<S>(250, 0.0011, 0.0005), all) == MaskVerdict::kept);  // costs nothing
  CHECK(arbitrate_mask(pose<S>(60, 0.004, 0.003), all) ==
        MaskVerdict::one_motion);                                             // costs, and differs by chance
  CHECK(arbitrate_mask(pose<S>(60, 0.004, 0.03), all) == MaskVerdict::kept);  // what it covers has moved
  CHECK(arbitrate_mask(pose<S>(10, 0.004, 0.03), all) == MaskVerdict::starved);
  CHECK(arbitrate_mask(PoseResult<S>(), all) == MaskVerdict::starved);
  CHECK(arbitrate_mask(pose<S>(10, 0.004, 0), pose<S>(12, 0.001, 0)) == MaskVerdict::kept);  // none is better
  CHECK(to_string(MaskVerdict::one_motion) == "one_motion");
}
