// SPDX-License-Identifier: BSD-3-Clause
// Keyframes beside each other that see the same points, with noise.
#pragma once

#include <Eigen/Core>

#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/runtime/slam/types.hpp"
#include "random.hpp"

namespace dynslam::test {

/// @param step  between the keyframes [m]
inline runtime::LocalMap row_of_keyframes(const Pinhole<double>& camera, int points, int keyframes,
                                          double step, Rng& rng) {
  runtime::LocalMap map;
  for (int j = 0; j < points; ++j) {
    runtime::LocalMap::PointType point;
    point.p_w = {rng.uniform(-1, 1), rng.uniform(-0.8, 0.8), rng.uniform(2, 3)};
    (void)map.add_point(point);
  }
  for (int k = 0; k < keyframes; ++k) {
    FeatureFrame<double> frame;
    frame.T_c_w = SE3d(SO3d(), Eigen::Vector3d(step * k, 0, 0));
    for (int j = 0; j < points; ++j) {
      const Eigen::Vector3d p_c = frame.T_c_w * map.point(j).p_w;
      const auto x = camera.project(p_c);
      if (!x) continue;
      Feature f;
      f.x = static_cast<float>(x->x() + rng.normal());
      f.y = static_cast<float>(x->y() + rng.normal());
      f.depth = static_cast<float>(p_c.z());
      frame.features.push_back(f);
      frame.point.push_back(j);
      frame.descriptors.emplace_back();
    }
    (void)map.add_keyframe(frame);
  }
  return map;
}

}  // namespace dynslam::test
