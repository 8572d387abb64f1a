// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/geometry/se3.hpp"

namespace dynslam::test {

/// How far two poses are apart: the Frobenius norm of what their 4 x 4 matrices differ by.
template <class S>
[[nodiscard]] double pose_distance(const SE3<S>& a, const SE3<S>& b) {
  return static_cast<double>((a.matrix() - b.matrix()).norm());
}

}  // namespace dynslam::test
